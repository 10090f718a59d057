"""The compiled loops against the plain NumPy definitions."""

import subprocess
import sys

import numpy as np
import pytest
from kernel_samples import ALL, KINDS, rows

from kineme.kernels import averaged

# Around the register block (4 rows, 2 features), the panel (64 or 128 columns) and the tile (256 rows).
SHAPES = [(1, 1, 2), (1, 130, 6), (3, 1, 10), (127, 129, 8), (257, 5, 14), (300, 131, 2), (6, 65, 10), (5, 63, 14)]


def both(kernel, A, B, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", "never")
    plain = kernel(A, B)
    monkeypatch.setenv("KINEME_COMPILED", "always")
    return plain, kernel(A, B)


def assert_equal_up_to_rounding(plain, compiled):
    tolerance = 1e-11 if plain.dtype == np.float64 else 2e-5
    assert compiled.dtype == plain.dtype
    np.testing.assert_allclose(compiled, plain, rtol=0, atol=tolerance * np.abs(plain).max())


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("kernel", ALL.values(), ids=ALL)
def test_compiled_equals_twin_for_all_shapes(kernel, dtype, monkeypatch):
    for seed, (n_a, n_b, p) in enumerate(SHAPES):
        A, B = rows("normal", seed, n_a, p, dtype), rows("normal", seed + 50, n_b, p, dtype)
        assert_equal_up_to_rounding(*both(kernel.fit(rows("normal", 9, 20, p)), A, B, monkeypatch))


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("kernel", ALL.values(), ids=ALL)
def test_compiled_equals_twin_for_all_kinds_of_rows(kernel, dtype, monkeypatch):
    for seed, kind in enumerate(KINDS):
        A, B = rows(kind, seed, 30, 6, dtype), rows(kind, seed + 50, 20, 6, dtype)
        kernel = kernel.fit(A)
        assert_equal_up_to_rounding(*both(kernel, A, B, monkeypatch))
        assert_equal_up_to_rounding(*both(kernel, A, None, monkeypatch))


@pytest.mark.parametrize("kernel", ALL.values(), ids=ALL)
def test_equal_rows_are_as_similar_as_can_be(kernel, monkeypatch):
    kernel = kernel.fit(rows("normal", 0))
    same = np.tile(rows("normal", 1, 1), (5, 1))
    plain, compiled = both(kernel, same, None, monkeypatch)
    assert_equal_up_to_rounding(plain, compiled)
    np.testing.assert_allclose(plain, plain[0, 0])


def test_a_pair_does_not_depend_on_its_place(monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", "always")
    A = rows("normal", 0, 300, 22)
    kernel = ALL["truncated"].fit(A)
    gram = kernel(A)
    assert kernel(A[290:291], A[7:8])[0, 0] == gram[290, 7] == gram[7, 290]


def test_one_compilation_per_dtype(monkeypatch):
    """Writable, read-only, sliced and per-dimension rows share it: each further one would cost seconds."""
    monkeypatch.setenv("KINEME_COMPILED", "always")
    from kineme.kernels import _compiled

    for dtype in (np.float64, np.float32):
        A = rows("normal", 0, dtype=dtype)
        frozen = A.copy()
        frozen.flags.writeable = False
        for X in (A, frozen, A[::2], np.asfortranarray(A)):
            ALL["truncated"].fit(A)(X)
            averaged(ALL["truncated"], 3).fit(A)(X, A)
    assert len(_compiled.truncated_sums.signatures) <= 2


def test_importing_kernels_imports_neither_numba_nor_scikit_learn():
    code = "import sys, kineme.kernels; print([m for m in ('numba', 'sklearn', 'scipy') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
