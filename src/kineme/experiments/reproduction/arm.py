"""The paper's robot: what it executes, in one part of the reproduction."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import sklearn

from kineme.datasets.lasa import PAPER_LETTERS
from kineme.experiments.reproduction import paper
from kineme.experiments.reproduction.arm_recordings import executed, missing_extra
from kineme.experiments.reproduction.experiments import features_and_labels, run_nearest, run_svm, usable
from kineme.experiments.reproduction.protocol import draw

_SVM_SHARE = 4  # the SVM runs on one draw in four


def run_arm(draws: int, seed: int, dpi: int) -> dict[str, Any]:
    """Everything that needs an arm.

    Returns
    -------
    dict
        ``missing``: what is not installed, as a sentence, and then nothing else; or ``paper`` and ``lasa-26``, the
        accuracies of each draw on joint positions as of `experiments.run_draw`, ``error``, ``movements`` and
        ``seconds`` of inverse kinematics, ``letter``, numbers of Figure 7, and ``figure``, its caption and pictures.
    """
    if missing := missing_extra():
        return {"missing": missing}
    from kineme.experiments.reproduction.arm_letter import CAPTION, draw_letter, write_letter
    from kineme.experiments.reproduction.figures import one_c
    from kineme.output.figures import render

    demos, left_out = usable("lasa-26")
    started = time.perf_counter()
    joints, error = executed(demos)
    seconds = round(time.perf_counter() - started, 2)
    letter = write_letter(one_c(seed))
    of_letters = joints[np.isin(np.asarray(joints.labels), PAPER_LETTERS)]
    return {
        "paper": _draws(of_letters, draws, seed, svm=True, left_out=[]),
        "lasa-26": _draws(joints, draws, seed, svm=False, left_out=left_out),
        "error": error,
        "movements": len(joints),
        "seconds": seconds,
        "letter": letter.numbers,
        "figure": (CAPTION, render(draw_letter(letter), dpi)),
    }


def _draws(joints: Any, draws: int, seed: int, svm: bool, left_out: list[str | None]) -> list[dict[str, Any]]:
    """The same draws as of the recordings themselves."""
    features, labels = features_and_labels(joints)
    results = []
    for k in range(draws):
        chosen = draw(labels, paper.PER_CLASS, seed, k)
        rows, y = {key: X[chosen] for key, X in features.items()}, labels[chosen]
        result = run_nearest(rows, y) | {"left_out": left_out}
        if svm and k % _SVM_SHARE == 0:
            with sklearn.config_context(skip_parameter_validation=True):
                result |= run_svm(rows, y, diagnosis=False)
        results.append(result)
    return results
