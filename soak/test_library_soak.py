"""The faults of `tests/library/test_library_faults.py`, many times, at random moments, in processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from library_crashes import BATCH, check_what_is_left, draw_batch, kill_while_learning
from library_samples import contents, draw_movements

from kineme import ActionLibrary
from kineme.errors import DataError
from kineme.library.storage.connection import FILE

KILLS, KILLS_OF_ONE_LIBRARY = 100, 10
FLIPS = 3000
SECONDS = 20.0

WRITER = """
import sys
from library_crashes import draw_batch
from kineme import ActionLibrary
with ActionLibrary(sys.argv[1], wait=60) as library:
    order = list(range(60))[:: int(sys.argv[2])]
    print(sum(library.learn(draw_batch(k)).added for k in order))
"""

READER = f"""
import sys, time
from kineme import ActionLibrary
end, looks = time.monotonic() + float(sys.argv[2]), 0
with ActionLibrary(sys.argv[1], read_only=True) as library:
    while time.monotonic() < end:
        ids = library.ids()
        assert len(ids) % {BATCH} == 0, len(ids)
        assert sum(len(symbol) for symbol in library.symbols()) % {BATCH} == 0
        if len(ids):
            library.movements(ids=ids[-{BATCH}:]), library.features(ids[:{BATCH}]), library.primitives(ids=ids[-3:])
        looks += 1
print(looks)
"""


def _start(code, *arguments):
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1] / "tests" / "library")}
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)


@pytest.mark.parametrize("seed", range(KILLS // KILLS_OF_ONE_LIBRARY))
def test_killed_at_random_moments(tmp_path, seed):
    rng = np.random.default_rng(seed)
    before = 0
    for _ in range(KILLS_OF_ONE_LIBRARY):
        acknowledged = kill_while_learning(tmp_path, rng.uniform(0, 0.3))
        n = check_what_is_left(tmp_path, acknowledged)
        assert n >= before
        before = n


def test_two_writing_and_four_reading_processes(tmp_path):
    with ActionLibrary(tmp_path, create=True):
        pass
    readers = [_start(READER, tmp_path, SECONDS) for _ in range(4)]
    writers = [_start(WRITER, tmp_path, step) for step in (1, -1)]
    added = [int(writer.communicate()[0]) for writer in writers]
    looks = [int(reader.communicate()[0]) for reader in readers]
    assert min(looks) > 0
    with ActionLibrary(tmp_path) as library:
        assert sum(added) == len(library) == 60 * BATCH
        assert library.verify() == []
        assert all(library.learn(draw_batch(k)).added == 0 for k in range(60))


def test_a_disk_that_fills_up_while_learning(tmp_path):
    place = tmp_path / "disk"
    place.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=12m", "tmpfs", place], check=False).returncode:
        pytest.skip("mounting needs rights that this user does not have")
    try:
        with ActionLibrary(place / "actions", create=True) as library:
            added = 0
            with pytest.raises(DataError, match=r"expected room to write to .* free some space and run it again"):  # noqa: PT012
                for k in range(1000):
                    added += library.learn(draw_movements(200, seed=k)).added
            assert len(library) == added > 0
            assert library.verify() == []
            subprocess.run(["mount", "-o", "remount,size=64m", place], check=True)
            assert sum(library.learn(draw_movements(200, seed=k)).known for k in range(k + 1)) == added
            assert library.verify() == []
    finally:
        subprocess.run(["umount", place], check=True)


@pytest.mark.parametrize("seed", range(3))
def test_flipped_bytes_are_never_read(tmp_path, seed):
    with ActionLibrary(tmp_path, create=True) as library:
        library.learn(draw_movements(12, labels=["wave", "nod", "bow"] * 4))
        library.describe("wave", "with the hand")
        library.assign([1, 2], "tilt")
        library.delete([5])
        expected = contents(library)
    whole = (tmp_path / FILE).read_bytes()
    rng = np.random.default_rng(seed)
    places = np.flatnonzero(np.frombuffer(whole, np.uint8))
    for at in rng.choice(places, FLIPS // 3, replace=False).tolist():
        spoiled = bytearray(whole)
        spoiled[at] ^= int(rng.integers(1, 256))
        (tmp_path / FILE).write_bytes(spoiled)
        try:
            with ActionLibrary(tmp_path, read_only=True) as library:
                problems = library.verify()
                try:
                    assert contents(library) == expected, f"byte {at}"
                except DataError:
                    assert problems, f"byte {at}"
        except DataError:
            pass


def test_killed_while_exporting_and_importing(tmp_path):
    code = "import sys, kineme; l = kineme.ActionLibrary(sys.argv[1]); print(1, flush=True); l.export(sys.argv[2])"
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(draw_movements(3000, n_samples=200))
        expected = contents(library)
    rng = np.random.default_rng(0)
    for k in range(10):
        process = _start(code, tmp_path / "actions", tmp_path / f"export {k}")
        process.stdout.readline()
        time.sleep(rng.uniform(0, 0.2))
        process.kill()
        process.communicate()
        if (tmp_path / f"export {k}").exists():  # then it is whole
            with ActionLibrary.import_(tmp_path / f"export {k}", tmp_path / f"copy {k}") as copy:
                assert contents(copy) == expected
    with ActionLibrary(tmp_path / "actions") as library:
        assert library.verify() == []
