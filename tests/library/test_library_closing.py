"""A library is closed while other threads read: they finish, and later calls are refused in words."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
import threading

import pytest
from library_samples import draw_movements

from kineme import ActionLibrary
from kineme.errors import DataError, SpecificationError

CLOSED = r"expected an open library, got .*library\.sqlite, which has been closed; open it again"

#: Threads that read one large library while the first one closes it; SQLite itself ends the process.
CLOSE_BESIDE_READERS = """
import sys, threading, time
from kineme import ActionLibrary
from kineme.errors import DataError

def read(library):
    try:
        while True:
            library.movements(), library.symbols(), library.history()
    except DataError as error:
        assert "which has been closed" in str(error), error
        refused.append(error)

for _ in range(15):
    refused = []
    library = ActionLibrary(sys.argv[1], read_only=True)
    threads = [threading.Thread(target=read, args=(library,)) for _ in range(4)]
    for thread in threads:
        thread.start()
    time.sleep(0.03)
    library.close()
    for thread in threads:
        thread.join()
    assert len(refused) == 4
"""


@pytest.fixture
def folder(tmp_path):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(draw_movements(300, n_samples=10, labels=[f"{i % 40}" for i in range(300)]))
    return tmp_path / "actions"


def test_closing_beside_threads_that_read_ends_no_process(folder):
    done = subprocess.run([sys.executable, "-c", CLOSE_BESIDE_READERS, folder], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()[-2000:]


def test_closing_waits_for_the_threads_that_read(folder):
    library = ActionLibrary(folder)
    with library.store.reading() as connection:
        closing = threading.Thread(target=library.close)
        closing.start()
        closing.join(0.1)
        assert closing.is_alive()
        with pytest.raises(DataError, match=CLOSED), library.store.writing("rename"):
            pass
        with library.store.reading() as again:  # who reads may go on
            assert again is connection
            assert again.execute("SELECT count(*) FROM movement").fetchone() == (300,)
    closing.join(300)
    assert not closing.is_alive()


def test_a_closed_library_says_so(folder):
    library = ActionLibrary(folder)
    library.close()
    library.close()
    for use in (len, ActionLibrary.movements, ActionLibrary.symbols, lambda it: it.rename("1", "one")):
        with pytest.raises(DataError, match=CLOSED):
            use(library)


def test_a_library_is_not_pickled_but_says_that_each_process_opens_it(folder):
    with ActionLibrary(folder, read_only=True) as library:
        for copied in (pickle.dumps, copy.deepcopy):
            with pytest.raises(SpecificationError, match=r"the open one in .*actions to be .* open it in each process"):
                copied(library)
        assert len(copy.copy(library)) == 300  # over the same connection
