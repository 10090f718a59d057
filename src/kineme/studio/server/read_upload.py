"""Read a file that somebody sent, in a process of its own with little memory, which can be ended.

Run as ``python -m kineme.studio.server.read_upload FILE RESULT BYTES SECONDS``, with the options of the reader as JSON
on the standard input. The result is an archive of plain arrays and JSON, or the text of a refusal; beside it lies what
`table_preview` returns.
"""

from __future__ import annotations

import json
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from kineme.errors import DataError, KinemeError
from kineme.io.reading.merge_files import Recordings, Source
from kineme.io.reading.recordings import read_recordings
from kineme.io.records import Problem
from kineme.movements.channels.channel import channels_from_data, channels_to_data
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import Movements, of_channels
from kineme.studio.server.importing import array_preview, table_preview

REFUSED = 3  # exit code
_ARRAYS = ("offsets", "durations", "stamps")


def save(recordings: Recordings, path: Path) -> None:
    """Write recordings to an archive, as they were recorded."""
    demos = recordings.demonstrations
    movements = demos.movements
    header = {
        "channels": None if demos.channels is None else channels_to_data(demos.channels),
        "n_dims": demos.n_dims,
        "dimensions": movements.dimensions,
        "sources": [list(source) for source in recordings.sources],
        "problems": [[problem.file, problem.line, problem.reason] for problem in recordings.problems],
    }
    arrays = {
        "header": np.frombuffer(json.dumps(header).encode(), np.uint8),
        "recorded": demos.recorded,
        **{name: getattr(movements, name) for name in _ARRAYS},
    }
    with path.open("wb") as file:
        np.savez(file, **arrays)


def load(path: Path) -> Recordings:
    """Read such an archive; a DataError of one that `save` did not write."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            recorded, offsets, durations, stamps = (archive[name] for name in ("recorded", *_ARRAYS))
            header = json.loads(archive["header"].tobytes())
        sources = tuple(Source(*source) for source in header["sources"])
        names = tuple(f"{source.path}#{source.place}" if source.place else source.path for source in sources)
        dimensions = None if header["dimensions"] is None else tuple(header["dimensions"])
        movements = Movements(recorded, offsets, durations, stamps, None, names, dimensions)
        if header["channels"] is not None:
            movements = of_channels(movements, channels_from_data(header["channels"], header["n_dims"]))
        problems = tuple(Problem(*problem) for problem in header["problems"])
        return Recordings(Demonstrations.of_movements(movements), sources, problems, ())
    except (KinemeError, OSError, ValueError, LookupError, TypeError) as error:
        raise DataError(f"expected the file as it was read, got something else ({error}); send it again") from error


def _limit(beyond: int, seconds: int) -> None:
    """Allow so many bytes and seconds more, where the system can: nobody ends it once the studio was killed."""
    status = Path("/proc/self/status")
    if not status.exists():
        return
    import resource

    sizes = [line.split()[1] for line in status.read_text().splitlines() if line.startswith("VmSize")]
    most = int(sizes[0]) * 1024 + beyond
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))


def main() -> None:
    """Read the file that the arguments name."""
    path, result, beyond, seconds = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    options = json.load(sys.stdin)
    _limit(beyond, seconds)
    preview = None
    with suppress(KinemeError, MemoryError):
        preview = table_preview(path)
    try:
        save(read_recordings(path, **options), result)
    except (KinemeError, MemoryError) as error:
        result.write_text(str(error) or "expected a file that fits into memory, got a larger one", encoding="utf-8")
        preview = preview or array_preview(path)
        sys.exit(REFUSED)
    finally:
        result.with_suffix(".json").write_text(json.dumps(preview), encoding="utf-8")


if __name__ == "__main__":
    main()
