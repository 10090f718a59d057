"""A process that learns until it is killed, and a look at what it left behind.

``python library_crashes.py FOLDER`` learns batches of movements and prints the number of each one that was committed.
"""

from __future__ import annotations

import subprocess
import sys
import time
from itertools import count
from pathlib import Path

import numpy as np
from library_samples import draw_movements

from kineme import ActionLibrary

BATCH = 25


def draw_batch(k):
    """The same movements for the same k, always."""
    return draw_movements(BATCH, seed=k, n_samples=30, labels=[f"kind {i % 3}" for i in range(BATCH)])


def learn_until_killed(folder):
    with ActionLibrary(folder, create=True) as library:
        for k in count():
            library.learn(draw_batch(k))
            print(k, flush=True)


def kill_while_learning(folder, after):
    """Start a learning process, kill it `after` seconds past its first batch; gives the last batch it acknowledged."""
    process = subprocess.Popen([sys.executable, __file__, str(folder)], stdout=subprocess.PIPE, text=True)
    first = process.stdout.readline()
    time.sleep(after)
    process.kill()
    rest = process.communicate()[0].split()
    return int(rest[-1] if rest else first)


def check_what_is_left(folder, acknowledged):
    """Whole batches, none of them lost, none twice, each as it was learned; learning again adds none of them."""
    with ActionLibrary(folder) as library:
        assert library.verify() == []
        n, rest = divmod(len(library), BATCH)
        assert rest == 0
        assert n > acknowledged
        assert library.version == n
        for k in {0, acknowledged, n - 1}:
            batch = draw_batch(k)
            report = library.learn(batch)
            assert (report.added, report.duplicates) == (0, BATCH)
            assert report.ids.tolist() == list(range(k * BATCH + 1, (k + 1) * BATCH + 1))
            np.testing.assert_allclose(library.movements(ids=report.ids).positions, batch.positions, atol=1e-5)
        return n


if __name__ == "__main__":
    learn_until_killed(Path(sys.argv[1]))
