"""A process that serves a library: ``python -m bench.library_serving FOLDER QUESTIONS`` prints what it took as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from time import perf_counter, process_time

BEGIN = perf_counter()


def main(folder: str, questions: str) -> None:
    """Open, answer every question alone, and say how long it took and how much memory."""
    import kineme

    kineme.ActionLibrary  # noqa: B018 - loads on use
    imported = perf_counter()
    with kineme.ActionLibrary(folder) as library:
        opened = perf_counter()
        import numpy as np

        asked = np.load(questions)
        library.recognize(asked[0])
        first = perf_counter()
        seconds, processor, found = [], process_time(), []
        for one in asked:
            begin = perf_counter()
            answer = library.recognize(one)
            seconds.append(perf_counter() - begin)
            found.append((answer.label, answer.ranked[0], answer.nearest[0].index))
        processor = process_time() - processor
    result = {
        "import": imported - BEGIN,
        "open": opened - imported,
        "first": first - opened,
        "median": float(np.median(seconds)),
        "p95": float(np.quantile(seconds, 0.95)),
        "processor": processor / len(asked),
        "megabytes": _peak(),
        "found": found,
    }
    print(json.dumps(result))


def _peak() -> float:
    """Peak resident memory [MB]; getrusage would count the process that started this one."""
    status = Path("/proc/self/status").read_text()
    return float(status.partition("VmHWM:")[2].split()[0]) / 1024


if __name__ == "__main__":
    main(*sys.argv[1:])
