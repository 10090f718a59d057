"""Motion files (``.mot``) and storage files (``.sto``) of OpenSim, of the older and of the newer version of their head.

Source: OpenSim, "Motion (.mot) Files" and "Storage (.sto) Files". Lines such as ``nRows=153`` and ``inDegrees=yes``, or
of SIMM ``datarows 153``, end with ``endheader``; then come a row of names, the first of them ``time``, and the samples.
Where ``DataType`` says ``Quaternion`` or ``Vec3``, a cell holds several numbers between commas, of a quaternion
w, x, y, z.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from kineme.errors import DataError
from kineme.io.motion_capture.export_heads import STAMP, ExportHead

_KEY = re.compile(
    r"(version|nrows|ncolumns|indegrees|datatype|datarate|opensimversion|num_\w+)\s*=|(datacolumns|datarows)\s+\d",
    re.IGNORECASE,
)
_END = "endheader"
_AXES = {"quaternion": "wxyz", "vec3": "xyz", "unitvec3": "xyz"}
#: A column that has one of these words is no coordinate, and its unit is not said by ``inDegrees``.
_OTHER = re.compile(
    r"force|torque|moment|activation|excitation|length|veloc|speed|accel|power|emg|fiber|tendon|control|reserve|residual"
    r"|(^|_)[vp][xyz]$|multiplier|lambda|/forceset/"
)
_TRANSLATION = re.compile(r"_t[xyz](/value)?$")


def opensim_head(lines: Sequence[str], cells_of: Callable[[str, str], list[str]]) -> ExportHead | None:
    """The head of a motion or storage file of OpenSim, or None if the first lines do not look like one."""
    if not any(_KEY.match(line.strip().lstrip("\ufeff")) for line in lines[:3]):
        return None
    at = next((k for k, line in enumerate(lines) if line.strip().lower() == _END), None)
    if at is None:
        raise DataError(f"expected {_END!r} at the end of the head of an OpenSim file, got none")
    said = dict(_pair(line) for line in lines[:at] if "=" in line)
    named = next((k for k in range(at + 1, len(lines)) if lines[k].strip()), None)
    sample = None if named is None else next((k for k in range(named + 1, len(lines)) if lines[k].strip()), None)
    if named is None or sample is None:
        raise DataError(f"expected names and samples below {_END!r} of an OpenSim file, got none")
    separator = "\t" if "\t" in lines[sample].strip() else None
    names = cells_of(lines[named], "\t") if "\t" in lines[named].strip() else lines[named].split()
    while names and not names[-1]:
        names.pop()
    if not names or names[0].lower() != "time":
        raise DataError(f"expected 'time' as first column of an OpenSim file, got {names[:1]}")
    kind = said.get("datatype", "double").lower()
    packed = kind not in ("double", "float", "int")
    heads, units = [STAMP], ["s"]
    if packed:
        cells = cells_of(lines[sample], "\t")[1:]
        for name, cell in zip(names[1:], cells, strict=False):
            n = cell.count(",") + 1
            axes = _AXES.get(kind, "") if n == len(_AXES.get(kind, "")) else [str(k) for k in range(n)]
            heads += [f"{name}.{axis}" for axis in axes]
            units += [said.get("units", "") if kind == "vec3" else ""] * n
    else:
        heads += names[1:]
        units += [_unit(name, said.get("indegrees", ""), lines[0]) for name in names[1:]]
    return ExportHead("OpenSim", separator, tuple(heads), tuple(units), named + 1, packed=packed)


def _pair(line: str) -> tuple[str, str]:
    key, _, value = line.partition("=")
    return key.strip().lower(), value.strip()


def _unit(name: str, in_degrees: str, title: str) -> str:
    """The unit of a column: ``inDegrees`` says it of coordinates that turn, and those that shift are in meters.

    Without degrees, radians are sure only where the title says that the columns are coordinates.
    """
    plain = name.lower()
    coordinates = "coordinates" in title.lower() or plain.endswith("/value")
    if in_degrees.lower() not in ("yes", "no") or _OTHER.search(plain):
        return ""
    if any(word in title.lower() for word in ("force", "speed", "accel", "control", "activation")):
        return ""
    if _TRANSLATION.search(plain):
        return "m"
    return "deg" if in_degrees.lower() == "yes" else "rad" if coordinates else ""
