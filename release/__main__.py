"""Build, check, install and try what is published: ``python -m release [PYTHON ...]``."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from release.build import build
from release.contents import ROOT
from release.fresh import check_base, check_extras


def main(pythons: list[str]) -> int:
    """Each Python that is found gets an empty environment; the first also gets the extras."""
    wheel = build(ROOT / "out" / "package")
    found = [python for python in pythons if _is_there(python)]
    if not found:
        raise SystemExit(f"none of these Pythons is there: {', '.join(pythons)}")
    for k, python in enumerate(found):
        for check in (check_base, check_extras)[: 1 if k else 2]:
            began = time.perf_counter()
            with tempfile.TemporaryDirectory() as folder:
                check(python, wheel, Path(folder))
            print(f"== {python}, {check.__name__}: {time.perf_counter() - began:.0f} s", flush=True)
    missing = [python for python in pythons if python not in found]
    print(f"tried: {', '.join(found)}; not found: {', '.join(missing) or 'none'}")
    return 0


def _is_there(python: str) -> bool:
    try:
        return subprocess.run([python, "-c", ""], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:] or [sys.executable]))
