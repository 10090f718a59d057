"""Compile ahead what the first answers would wait for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition.recognizer import Recognizer
from kineme.runtime.compiled import load_compiled

_NUMBERS = (4, 30, 200)  # of movements: little work and much are compiled apart
_SAMPLES = 1000


def warm_up(n_dims: Sequence[int] = (2, 3)) -> None:
    """Compile now what recognizing movements needs, instead of in the first call.

    It takes some twenty seconds on a free core, up to a minute on a busy one. Compiled functions are kept on disk, so
    that once a machine is enough, as when an image is built, and once after an update; later processes read them in a
    few seconds. If the environment variable ``KINEME_COMPILED`` is "never", nothing is compiled.

    Parameters
    ----------
    n_dims : sequence of int, default (2, 3)
        Dimensions of the movements that will be recognized; each number is compiled apart.

    Examples
    --------
    >>> import kineme
    >>> kineme.warm_up([2])
    """
    load_compiled()
    rng = np.random.default_rng(0)
    even = np.linspace(0, 1, _SAMPLES)
    waves = np.sin(np.pi * even[:, None] * np.arange(1, 5))
    for d in n_dims:
        for n in _NUMBERS:
            moved = waves[:: _SAMPLES // 50] @ rng.normal(size=(n, 4, d))
            recognizer = Recognizer().fit(moved, np.arange(n) // 2)
            recognizer.recognize(moved[:2])
            recognizer = Recognizer().fit(moved, np.arange(n))  # labels alone skip pairs, see `most_similar`
            recognizer.predict(moved)
        for times in (even, even**2):  # evenly timed and not, as recordings are
            timed = Demonstrations.from_arrays(waves @ rng.normal(size=(20, 4, d)), times=times)
            recognizer = Recognizer().fit(timed, np.arange(len(timed)) // 2)
            recognizer.predict_partial(timed)
            recognizer.spot(timed[0])
            recognizer.recognize(timed[0])
