"""What all tests share: deterministic hypothesis, smooth movements, a comparison in units of the result, a browser."""

from __future__ import annotations

import gc
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from soaking import SOAK, examples, left_to_soak

settings.register_profile(
    "deterministic",
    derandomize=True,
    deadline=None,
    max_examples=examples(6),
    database=None,
    suppress_health_check=[HealthCheck.differing_executors],
)
settings.load_profile("deterministic")


def pytest_collection_modifyitems(config, items):
    """Leave repetitions to `make soak`; a test that is named has all its cases. Examples of the docs come first."""
    items.sort(key=lambda item: item.path.name != "test_examples.py")  # else one worker ends alone with them
    if SOAK or any("::" in argument for argument in config.args):
        return
    if left := set(left_to_soak(items)):
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if item not in left]


def pytest_collection_finish():
    """Leave what was collected to no search for garbage, and search seldom: ten thousand tests are no garbage."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 10, 10)


def _make_movement(seed, n_dims=2, n_samples=None, even=True):
    """Times (T,) over 2 s and positions (T, d): a straight line, so that g - x0 is not small, with four sines on it."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(40, 90)) if n_samples is None else n_samples
    u = np.linspace(0, 1, n) if even else np.append(0, np.cumsum(rng.uniform(0.4, 1.6, n - 1)))
    u = u / u[-1]
    k = np.arange(1, 5)
    line = rng.choice([-1, 1], n_dims) * rng.uniform(1, 2, n_dims)
    waves = rng.uniform(-0.5, 0.5, (4, n_dims)) / k[:, None]
    x = rng.normal(size=n_dims) + u[:, None] * line + np.sin(np.pi * u[:, None] * k) @ waves
    return 2.0 * u, x


def _agree(actual, expected, tolerance=1e-7):
    """Equal within `tolerance` of the largest expected number."""
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * np.abs(expected).max())


@pytest.fixture(scope="session")
def make_movement():
    return _make_movement


@pytest.fixture(scope="session")
def agree():
    return _agree


@pytest.fixture(scope="session")
def development_data():
    """The folder with recordings of people for development, which are no part of the project."""
    folder = Path(os.environ.get("KINEME_RECORDINGS", Path(__file__).resolve().parents[2] / "shared" / "data"))
    if not (folder / "gestures3d.npz").is_file():
        pytest.skip(f"no gestures3d.npz in {folder}; name the folder in the environment variable KINEME_RECORDINGS")
    return folder


@pytest.fixture(scope="session")
def gestures(development_data):
    """Digits and solids that five people drew in the air, and who."""
    from kineme_experiments.evaluation.data import load_data

    data = load_data(str(development_data / "gestures3d.npz"))
    return data.demonstrations, np.asarray(data.people)


@pytest.fixture(scope="session")
def digits(gestures):
    """Digits that five people drew in the air, and who."""
    demos, people = gestures
    chosen = np.flatnonzero(np.char.isdigit(np.asarray(demos.labels, dtype=str)))
    return demos[chosen], people[chosen]


@pytest.fixture(scope="module")
def browser():
    """Chromium, of the path that benchmarks take.

    One for each module: while Playwright has its own event loop, a test can run no other.
    """
    from bench.browser import chromium_path

    playwright = pytest.importorskip("playwright.sync_api", reason="the package playwright is not installed")
    path = chromium_path()
    if path is None:
        pytest.skip("no chromium is installed")
    with playwright.sync_playwright() as started:
        # Painted without an emulated graphics card, which takes longer, as a process of its own does; WebGL has one.
        painting = ["--disable-gpu", "--in-process-gpu"]
        one_renderer = ["--process-per-site", "--renderer-process-limit=1"]  # each page would start one again
        browser = started.chromium.launch(executable_path=path, headless=True, args=painting + one_renderer)
        yield browser
        browser.close()
