"""Read recorded movements from a folder or a file of any format, see `kineme.files.formats`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from kineme.errors import DataError
from kineme.files.folders import files_under
from kineme.files.formats import data_set_of
from kineme.files.limits import max_file_bytes
from kineme.files.merge_files import Recordings, merge_files
from kineme.files.read_file import format_of, read_bytes, read_file
from kineme.movements.tables.layout import Column, Layout
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import Trajectory

Progress = Callable[[Sequence[Path]], Iterable[Path]]


def read_recordings(  # noqa: PLR0913 - one parameter per question that a table of samples may leave open
    path: str | Path,
    *,
    time: Column | None = None,
    columns: Column | Sequence[Column] | None = None,
    movement: Column | Sequence[Column] | None = None,
    label: Column | None = None,
    units: str | float | None = None,
    skip: str = "movement",
    kinds: Mapping[str, str] | None = None,
    topic: str | Sequence[str] | None = None,
    frame: str | Sequence[str] | None = None,
    follow_links: bool = False,
    progress: Progress | None = None,
) -> Recordings:
    """Read all movements of a folder, a file, or a data set that is a folder.

    In a folder, a movement that carries no label itself has the name of its file's innermost folder; files directly
    in the folder that is read have none. Hidden files are passed over. What cannot be read is listed, the rest is
    read. A file that would take more memory than `kineme.files.limits` allows is not read.

    Parameters
    ----------
    path : str or Path
        A folder, a file of a format in `kineme.files.formats.FORMATS`, or a folder of `DATA_SETS` there: one source.
    time, label : str or int, optional
        Columns of a table, by head or counted from 0. By default they are found by their heads.
    columns, movement : str or int or sequence of them, optional
        Columns of the coordinates, and of what tells movements apart. What several heads begin with, before a dot,
        stands for all of them: ``"wrist"`` for ``wrist.x`` and ``wrist.y``.
    units : {"s", "ms", "us", "ns"} or float, optional
        Unit of the time stamps, or its length in seconds. By default told by the head or by the stamps' size. As a
        number it is also the step between samples of files without time stamps.
    skip : {"movement", "sample"}, default "movement"
        Whether a missing or repeated sample costs its whole movement or is left out alone. Both are reported.
    kinds : mapping, optional
        What columns are, where their heads and values do not say it: ``{"gripper": "discrete", "q1": "angle",
        "a,b,c,d": "xyzw"}``, the last one a quaternion in that order; also ``"position"``; see
        `Demonstrations.channels`.
    topic : str or sequence of str, optional
        Topics of ROS bags; of several, the others are interpolated to the stamps of the first. By default the only
        one that can be read.
    frame : str or sequence of str, optional
        Frames of ROS bags as ``"parent:child"``: the pose of the child in the parent, composed of the transforms.
    follow_links : bool, default False
        Whether links that lead out of the folder are read; else they are problems. Links within it always are read.
    progress : callable, optional
        Wraps the list of files, to show how far the reading is.

    Raises
    ------
    DataError
        Nothing there, or nothing in it that can be read; the message gives the first problem.
    SpecificationError
        An unknown unit or choice, or a limit of memory that is no number.
    """
    max_file_bytes()
    layout = Layout(time, columns, movement, label, units, skip, kinds, topic, frame)
    path = Path(path)
    if path.is_dir() and data_set_of(path) is None:
        files, problems = files_under(path, follow_links)
        watched = files if progress is None else progress(files)
        read = [read_file(one, one.relative_to(path), layout, follow_links) for one in watched]
        return merge_files(read, str(path), problems, kinds)
    if not path.exists():
        raise DataError(f"expected a file or folder of recordings, found nothing at {str(path)!r}")
    return merge_files([read_file(path, name_of(path), layout, follow_links)], str(path), kinds=kinds)


def root_of(path: Path) -> Path:
    """The folder that the names of sources are relative to: a folder of files itself, else the folder around it."""
    return path if path.is_dir() and data_set_of(path) is None else path.parent


def name_of(path: Path) -> Path:
    """The name of a file or a data set; of the current folder too."""
    return Path(path.name or path.resolve().name)


def read_recordings_from_bytes(data: bytes, name: str, layout: Layout) -> Recordings:
    """Read what a file of that name would hold, for data that come from elsewhere."""
    return merge_files([read_bytes(data, Path(name), layout)], name, kinds=layout.kinds)


def read_recording(path: str | Path) -> Trajectory:
    """Read a file that holds one movement, in any format of `kineme.files.formats.FORMATS`.

    Raises
    ------
    DataError
        The file is not what its name says, or holds several movements; the message names the line.
    FileNotFoundError
        There is no such file.
    TrajectoryError
        The numbers are no movement, see `Trajectory`.
    """
    path = Path(path)
    if data_set_of(path) is None:
        format_of(path)
    path.stat()
    read = read_file(path, name_of(path), Layout())
    for problem in read.problems:
        raise problem.error(str(problem._replace(file=str(path))))
    one = merge_files([read], str(path))
    for problem in one.problems:
        raise problem.error(str(problem._replace(file=str(path))))
    if len(one) > 1:
        raise DataError(f"expected one movement in {path}, got {len(one)}; read them with read_recordings")
    named = replace(one.demonstrations.movements, names=(str(name_of(path)),), labels=None)
    return Demonstrations.of_movements(named)[0]
