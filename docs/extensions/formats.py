"""The pages about formats and schemas, from the tables and files that the code reads itself."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib.resources import files
from typing import Any

from extensions.tables import kind, table
from kineme.io.arrays.zarr_arrays import FORMAT_3
from kineme.io.reading.formats import DATA_SETS, FORMATS
from kineme.io.writing import annotations
from kineme.io.writing.write_movement import WRITERS
from kineme.reporting.figures import FORMATS as FIGURES

#: Endings that are read together -> what they are, and the extra that reading them takes.
_READ = {
    ".csv .tsv .txt": ("tables of text, wide and long; exports of OptiTrack, Vicon, Qualisys by their heads", ""),
    ".ts": ("series of time-series archives, one on a line", ""),
    ".parquet": ("tables of Apache Parquet, of lists too", "parquet"),
    ".npz .npy": ("arrays of NumPy: ragged movements, equal ones, trees by name", ""),
    ".json .jsonl .ndjson": ("objects with positions, or one on a line; trees by name", ""),
    ".mat": ("MATLAB up to version 7.2; the name of the file is the label", ""),
    ".h5 .hdf5": ("HDF5, a data set or group for each movement; MATLAB from 7.3", "hdf5"),
    ".zip": ("replay buffers in Zarr, as of UMI and Diffusion Policy", "zarr"),
    ".bvh": ("skeletons in motion: positions and rotations of joints", ""),
    ".c3d": ("markers of motion capture, or rotations of segments, binary", "mocap"),
    ".trc": ("markers of motion capture, text", ""),
    ".mot .sto": ("coordinates, markers and orientations of OpenSim and OpenSense", ""),
    ".mvnx": ("segments and joints of Xsens MVN", ""),
    ".bag .db3 .mcap": ("bags of ROS 1 and ROS 2, by topic or by frame", "ros"),
}  # fmt: skip
_FOLDERS = {
    "meta/info.json": ("data sets of LeRobot", "parquet"),
    "meta/episode_ends/.zarray": ("replay buffers in Zarr, as of UMI and Diffusion Policy", "zarr"),
    "metadata.yaml": ("bags of ROS 2", "ros"),
}
_ANNOTATIONS = {
    "csv": "a table that pandas reads", "json": "an object for programs", "elan": "ELAN",
    "audacity": "label tracks of Audacity",
    "bag": "a copy of the bag with one more topic", "lerobot": "a copy of the data set whose frames name motions",
}  # fmt: skip
_WRITTEN = {
    ".csv": "a table with `t` and the columns of the recording", ".npz": "arrays of NumPy",
    ".json": "an object of arrays",
    ".parquet": "a table of Apache Parquet; extra `parquet`",
}  # fmt: skip


def pages() -> Iterator[tuple[str, str]]:
    """File name and text of each page, in Markdown."""
    yield "formats.md", "\n".join(_formats())
    yield from _schemas()


def _formats() -> Iterator[str]:
    yield "# Formats\n"
    yield "What is read and written, from the tables that the code goes by. How columns are found and what they mean: "
    yield "[Recordings](../../guide/recordings.md).\n\n## Recordings that are read\n"
    covered = {ending for endings in _READ for ending in endings.split()}
    if covered != set(FORMATS) or {one.marker for one in DATA_SETS} - {FORMAT_3} != set(_FOLDERS):
        raise ValueError(f"expected a line for every format, found none for {covered ^ set(FORMATS)}")
    rows = [(_code(endings), what, _extra(extra)) for endings, (what, extra) in _READ.items()]
    rows += [(f"a folder with {_code(name)}", what, _extra(extra)) for name, (what, extra) in _FOLDERS.items()]
    yield from table(("ending", "what it is", "extra"), rows)
    yield "\n## Movements that are written\n\n`kineme generate -o`, `kineme.write_movement`, without rounding.\n"
    yield from table(("ending", "what it is"), [(_code(one), _WRITTEN[one]) for one in WRITERS])
    yield '\nPrimitives: `primitives.save("wave.kineme")`, `kineme generate --save`. Joints of an arm, bags and goals:'
    yield "[On the joints of an arm](../../guide/robots.md).\n\n## Annotations that are written\n"
    yield "`kineme annotate -o`, see [Long recordings](../../guide/long-recordings.md).\n"
    rows = [(name, _code(" ".join(one.endings)), _ANNOTATIONS[name]) for name, one in annotations.WRITERS.items()]
    yield from table(("name", "ending", "what it is"), rows)
    yield f"\n## Figures\n\n{_code(' '.join(f'.{kind}' for kind in FIGURES))}, byte for byte the same at every run."


_HEAD = ("key", "kind", "what it is")


def _schemas() -> Iterator[tuple[str, str]]:
    answer, grounding = (
        json.loads(files(package).joinpath(name).read_text(encoding="utf-8"))
        for package, name in (
            ("kineme.recognition", "answer.schema.json"),
            ("kineme.anchoring", "grounding.schema.json"),
        )
    )
    about = (
        "# JSON schema of an answer\n",
        f"{answer['description']} [Answers](../answers.md) has an example. In the package the schema is",
        f"`kineme/recognition/answer.schema.json`. Its name is `{answer['$id']}`.\n",
        *table(_HEAD, list(_keys(answer, ""))),
        f"\n## State of a movement under way\n\n{answer['$defs']['state']['description']}\n",
        *table(_HEAD, list(_keys(answer["$defs"]["state"], ""))),
    )
    yield "schema-answer.md", "\n".join([*about, _dropdown(answer)])
    about = (
        "# JSON schema of a grounding\n",
        f"{grounding['description']}\n\nWritten by `kineme library ground`; the schema itself by",
        f"`kineme library schema`. Its name is `{grounding['$id']}`.\n",
        *table(_HEAD, list(_keys(grounding, ""))),
    )
    yield "schema-grounding.md", "\n".join([*about, _dropdown(grounding)])


def _dropdown(schema: dict[str, Any]) -> str:
    return f"\n```{{dropdown}} The schema\n~~~json\n{json.dumps(schema, indent=1)}\n~~~\n```"


def _keys(schema: dict[str, Any], path: str) -> Iterator[tuple[str, str, str]]:
    for name, one in schema.get("properties", {}).items():
        needed = "" if name in schema.get("required", []) else " (optional)"
        yield f"`{path}{name}`{needed}", kind(one), one.get("description", "").replace("|", r"\|")
        yield from _keys(one, f"{path}{name}.")
        if isinstance(items := one.get("items"), dict):
            yield from _keys(items, f"{path}{name}[].")


def _code(endings: str) -> str:
    return ", ".join(f"`{one}`" for one in endings.split())


def _extra(name: str) -> str:
    return f"`{name}`" if name else ""
