"""What an evaluation runs on: a packaged data set, or a folder of recordings."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple

from kineme.datasets.lasa import LASA_26, PAPER_LETTERS, load_lasa
from kineme.errors import DataError, KinemeError
from kineme.io.recordings import read_recording
from kineme.trajectories.demonstrations import Demonstrations
from kineme.trajectories.trajectory import Trajectory

#: Name -> shapes.
PACKAGED = {"lasa": LASA_26, "lasa-letters": PAPER_LETTERS}


class DataSet(NamedTuple):
    """Labeled movements, and what was left out of them: file -> reason."""

    name: str
    demonstrations: Demonstrations
    left_out: dict[str, str]


def load_data(data: str) -> DataSet:
    """A packaged data set by its name, or a folder with one folder of recordings per label.

    A file that is no recording, a movement of other dimensions than most, and the only movement of a class are left
    out, and the reason is kept.

    Raises
    ------
    DataError
        No such folder, or fewer than two classes of at least two movements.
    """
    if data in PACKAGED:
        return DataSet(data, load_lasa(PACKAGED[data]), {})
    folder = Path(data)
    if not folder.is_dir():
        raise DataError(f"expected {', '.join(PACKAGED)} or a folder, found no folder {data!r}")
    left_out: dict[str, str] = {}
    read = _read_all(folder, left_out)
    _leave_out_odd_dimensions(read, left_out)
    sizes = Counter(one.label for one in read.values())
    for name in [name for name, one in read.items() if sizes[one.label] < 2]:
        left_out[name] = f"the only movement labeled {read.pop(name).label!r}"
    if len({one.label for one in read.values()}) < 2:
        raise DataError(
            f"expected at least two folders of at least two recordings each in {data}, found "
            f"{dict(sizes) or 'no recordings'}{_reasons(left_out)}"
        )
    return DataSet(folder.resolve().name, Demonstrations(list(read.values())), left_out)


def _read_all(folder: Path, left_out: dict[str, str]) -> dict[str, Trajectory]:
    """Relative path -> movement, labeled with its folder."""
    read = {}
    for path in sorted(one for one in folder.rglob("*") if one.is_file()):
        relative = path.relative_to(folder)
        if any(part.startswith(".") for part in relative.parts):
            continue
        name = relative.as_posix()
        if len(relative.parts) != 2:
            left_out[name] = "not directly in a folder named as its label"
            continue
        try:
            one = read_recording(path)
        except (KinemeError, OSError, UnicodeError) as error:
            left_out[name] = str(error).replace(str(path), name)
            continue
        read[name] = Trajectory(one.times, one.positions, label=relative.parts[0], name=name)
    return read


def _leave_out_odd_dimensions(read: dict[str, Trajectory], left_out: dict[str, str]) -> None:
    if not read:
        return
    n_dims = Counter(one.n_dims for one in read.values()).most_common(1)[0][0]
    for name in [name for name, one in read.items() if one.n_dims != n_dims]:
        left_out[name] = f"{read.pop(name).n_dims} dimensions where most have {n_dims}"


def _reasons(left_out: dict[str, str]) -> str:
    if not left_out:
        return ""
    name, reason = next(iter(left_out.items()))
    return f"; {len(left_out)} left out, the first {name}: {reason}"
