"""Numba is loaded once and as a whole, whatever threads, signals, damaged files and other processes do meanwhile."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib import import_module, invalidate_caches

import numpy as np
import pytest

from kineme.runtime.compiled import jit, tell_when_compiling
from soaking import SOAK

THREADS = """
import sys, threading, time, traceback
import numpy as np
from kineme import DMP, Recognizer, Trajectory
from kineme.kernels import Laplacian

rng = np.random.default_rng(0)
rows = rng.normal(size=(40, 40))
movements = [Trajectory(np.linspace(0, 2, 40) ** 1.1, rng.normal(size=(40, 2)).cumsum(axis=0)) for _ in range(30)]
recognizer = Recognizer().fit(movements[:6], list("ababab"))
expected = Laplacian(1.0)(rows), DMP().learn(movements).weights
assert "numba" not in sys.modules
started, failed = threading.Barrier(8), []

def call(work):
    started.wait()
    try:
        work()
    except BaseException:
        failed.append(traceback.format_exc())

def meanwhile(work):
    while "numba" not in sys.modules:
        time.sleep(0)
    work()

def users_own():
    import numba
    numba.njit(lambda x: x + 1)(1)

def kernel():
    meanwhile(lambda: Laplacian(1.0)(rows))

def learn():
    meanwhile(lambda: DMP().learn(movements))

threads = [threading.Thread(target=call, args=(work,)) for work in [recognizer.stream, kernel, FIRST, learn] * 2]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
assert not failed, failed[0]
np.testing.assert_allclose(Laplacian(1.0)(rows), expected[0], rtol=1e-9)
np.testing.assert_allclose(DMP().learn(movements).weights, expected[1], atol=1e-7 * abs(expected[1]).max())
import numba
assert numba.core and recognizer.stream()
"""


def run(code, **environment):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=os.environ
        | {"KINEME_COMPILED": "auto", "KINEME_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"}
        | environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.soak
@pytest.mark.parametrize("first", ["users_own", "recognizer.stream"][: 1 + SOAK])
def test_threads_may_make_the_first_compiled_call_at_the_same_time(first):
    run(THREADS.replace("FIRST", first))


SIDE_DOOR = """
import os, sys, threading, time
import numpy as np
from kineme.kernels import Laplacian

rows = np.random.default_rng(0).normal(size=(40, 40))

def by_the_side_door():
    while "numba" not in sys.modules:
        time.sleep(0)
    try:
        import numba.core.errors
    except Exception as error:
        print("Python refuses:", error)

other = threading.Thread(target=by_the_side_door)
other.start()
os.environ["KINEME_COMPILED"] = "always"
Laplacian(1.0)(rows)
other.join()
assert sys.modules["numba"].core and sys.modules["numba"].njit(lambda x: x + 1)(1) == 2
"""


@pytest.mark.soak
def test_a_thread_that_imports_a_part_of_numba_meanwhile_breaks_nothing():
    run(SIDE_DOOR)


INTERRUPTED = """
import sys

class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == "numba.core.compiler":
            sys.meta_path.remove(self)
            raise KeyboardInterrupt

sys.meta_path.insert(0, Interrupt())
from kineme.runtime import compiled
try:
    compiled.load_compiled()
    raise SystemExit("not interrupted")
except KeyboardInterrupt:
    pass
assert not [name for name in sys.modules if name.startswith("numba")]
compiled.load_compiled()
assert sys.modules["numba"].core and sys.modules["numba"].njit(lambda x: x + 1)(1) == 2
"""


def test_an_import_that_was_interrupted_begins_again():
    run(INTERRUPTED)


BROKEN = """
import sys, warnings
import numpy as np
from kineme.errors import SpecificationError
from kineme.kernels import Laplacian

sys.modules["numba"] = None  # Python's way of saying that it cannot be imported
rows = np.random.default_rng(0).normal(size=(40, 40))
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    for _ in range(3):
        Laplacian(1.0)(rows)
print(*(warning.message for warning in caught), sep="\\n")
import os
os.environ["KINEME_COMPILED"] = "always"
try:
    Laplacian(1.0)(rows)
except SpecificationError as error:
    print(error)
"""


def test_without_numba_everything_runs_plain_and_says_so_once():
    first, second = run(BROKEN).splitlines()
    assert first.startswith("Numba cannot be imported (ModuleNotFoundError: ")
    assert "goes on with plain NumPy" in first
    assert "KINEME_COMPILED=never" in first
    assert second.startswith("expected Numba to be importable, got ModuleNotFoundError: ")


@pytest.fixture
def doubled(tmp_path, monkeypatch):
    """Makes a function anew, as a new process would, with its machine code in the folder that is named."""
    from numba import config

    tmp_path.joinpath("doubled_in_place.py").write_text(
        "def double(x):\n    for i in range(len(x)):\n        x[i] *= 2\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    invalidate_caches()
    monkeypatch.delitem(sys.modules, "doubled_in_place", raising=False)
    function = import_module("doubled_in_place").double

    def make(folder):
        monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / folder))
        return jit(function)

    return make


def doubles(function, dtype):
    x = np.arange(4, dtype=dtype)
    function(x)
    return x.tolist() == [0, 2, 4, 6] and function.stats


def files(folder, ending):
    return sorted(folder.rglob(f"*.{ending}"))


def test_machine_code_of_two_processes_under_one_name_is_told_apart(doubled, tmp_path):
    """Both take number 1, each for its own arguments; the index of one and the file of the other remain."""
    assert doubles(doubled("one"), np.float32)
    assert doubles(doubled("other"), np.float64)
    (code,), (mixed,) = files(tmp_path / "one", "nbc"), files(tmp_path / "other", "nbc")
    shutil.copy(code, mixed)
    assert not doubles(doubled("other"), np.float64).cache_hits
    assert doubles(doubled("other"), np.float64).cache_hits  # written again


@pytest.mark.parametrize("ending", ["nbc", "nbi"])
@pytest.mark.parametrize("left", [0, 10, 100])
def test_damaged_machine_code_is_compiled_again(doubled, tmp_path, ending, left):
    assert doubles(doubled("one"), np.float64)
    (path,) = files(tmp_path / "one", ending)
    path.write_bytes(path.read_bytes()[:left])
    assert not doubles(doubled("one"), np.float64).cache_hits
    assert doubles(doubled("one"), np.float64).cache_hits


def test_machine_code_holds_the_constants_and_functions_of_other_files_as_they_are(tmp_path, monkeypatch):
    """An update that changes another file alone would go on with the machine code of before."""
    from numba import config

    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "code"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.syspath_prepend(tmp_path)

    def scale(factor, shift):
        imports = "from kineme.runtime.compiled import jit\n"
        texts = {
            "scale_factor": f"FACTOR = {factor}\n",
            "scale_shift": f"{imports}@jit\ndef shift(x):\n    return x + {shift}\n",
            "scale_loop": f"{imports}from scale_factor import FACTOR\nfrom scale_shift import shift\n"
            "@jit\ndef scale(x):\n    return shift(FACTOR * x)\n",
        }
        for name, text in texts.items():
            tmp_path.joinpath(f"{name}.py").write_text(text)
            monkeypatch.delitem(sys.modules, name, raising=False)
        invalidate_caches()
        function = import_module("scale_loop").scale
        return function(1.0), sum(function.stats.cache_hits.values())

    assert scale(2, 1) == (3.0, 0)
    assert scale(2, 1) == (3.0, 1)
    assert scale(3, 1) == (4.0, 0)
    assert scale(3, 2) == (5.0, 0)


def test_machine_code_that_cannot_be_kept_works(doubled, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile._open_for_write", full)
    assert doubles(doubled("one"), np.float64)
    assert not files(tmp_path, "nbc")


def test_compiling_is_told_once_and_only_where_nothing_is_on_disk(doubled):
    told = []
    tell_when_compiling(lambda: told.append("compiling"))
    assert doubles(doubled("one"), np.float64)
    assert told == ["compiling"]
    assert doubles(doubled("one"), np.float32)  # other arguments, the same process
    assert told == ["compiling"]
    tell_when_compiling(lambda: told.append("again"))
    assert doubles(doubled("one"), np.float64).cache_hits
    assert told == ["compiling"]
    tell_when_compiling(lambda: None)


def test_what_was_warmed_up_compiles_nothing_more():
    code = """
import numpy as np
import kineme
from kineme.runtime import compiled
from kineme.recognition.recognizer import warm_up

def versions():
    functions = [one for module in compiled._modules.values() for one in vars(module).values()]
    return sum(len(one.signatures) for one in functions if hasattr(one, "signatures"))

warm_up([2])
before = versions()
movements = kineme.load_lasa(["CShape", "GShape", "Line", "Spoon"])
recognizer = kineme.Recognizer().fit(movements)
recognizer.recognize(movements), recognizer.recognize(movements[0])
recognizer.predict_partial(movements[:3]), recognizer.spot(movements[0])
print(before > 10, versions() - before)
"""
    environment = {**os.environ, "KINEME_COMPILED": "auto"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.split() == ["True", "0"]
