"""What starting costs: processor time of whole processes, the bare interpreter's taken off where said."""

from __future__ import annotations

import resource
import subprocess
import sys
from importlib.util import find_spec

import numpy as np

from bench.rows import Row

_IMPORTS = {
    "bare": "pass",
    "numpy": "import numpy",
    "kineme": "import kineme",
    "DMP": "import kineme; kineme.DMP",
}
_HELP = "import sys; from kineme.cli import main; sys.argv = ['kineme', '--help']; main()"


def measure(quick: bool) -> list[Row]:
    repeats = 5 if quick else 25
    programs = _IMPORTS | ({"help": _HELP} if find_spec("kineme.cli") else {})
    seconds = _cpu_seconds(programs, repeats)
    details = {"repeats": repeats, "programs": programs, "seconds": seconds}
    numpy = seconds["numpy"]
    rows = [
        _beside_numpy("import kineme", seconds["kineme"], numpy, details),
        _beside_numpy("import kineme; kineme.DMP", seconds["DMP"], numpy, {}),
    ]
    if "help" in seconds:
        rows.append(
            Row("kineme --help beyond the interpreter", "s", seconds["help"] - seconds["bare"], target=("<=", 0.3))
        )
    return rows


def _beside_numpy(what: str, ours: float, numpy: float, details: dict[str, object]) -> Row:
    return Row(what, "ms", 1000 * ours, 1000 * numpy, "import numpy", ours / numpy, ("<=", 1.5), details)


def _cpu_seconds(programs: dict[str, str], repeats: int) -> dict[str, float]:
    """Median user and system time of each program, run in turns; the first turn fills the file caches."""
    times: dict[str, list[float]] = {name: [] for name in programs}
    for turn in range(repeats + 1):
        for name, program in programs.items():
            before = _children()
            subprocess.run([sys.executable, "-c", program], check=True, stdout=subprocess.DEVNULL)
            if turn:
                times[name].append(_children() - before)
    return {name: float(np.median(values)) for name, values in times.items()}


def _children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
