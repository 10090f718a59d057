"""The numbers of ``kineme reproduce`` with its defaults, computed once; all but the SVM on the large data set."""

import pytest

from kineme.experiments.reproduction.experiments import run_draw

DRAWS, SEED = 12, 0


@pytest.fixture(scope="session")
def default_draws():
    return {
        "paper": [run_draw("paper", SEED, k, svm=True) for k in range(DRAWS)],
        "lasa-26": [run_draw("lasa-26", SEED, k, svm=False) for k in range(DRAWS)],
    }
