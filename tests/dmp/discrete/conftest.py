"""Properties of DMPs are stated once and run over formulation x fit x regression x gating, in pairs."""

from __future__ import annotations

import pytest

from kineme import DMP
from kineme.dmp.discrete.specification import FORMULATIONS, GATINGS
from soaking import combined

FITS = (("forcing", "local"), ("forcing", "ridge"), ("trajectory", "local"))
DMPS = [
    DMP(formulation, n_basis=15, n_points=60, fit=fit, regression=regression, gating=gating)
    for formulation, (fit, regression), gating in combined(FORMULATIONS, FITS, GATINGS)
]


def _name(dmp):
    return f"{dmp.formulation}-{dmp.regression if dmp.fit == 'forcing' else dmp.fit}-{dmp.gating}"


def pytest_generate_tests(metafunc):
    """Run over every specification (`dmp`), or those that divide by g - x0 (`dividing_dmp`) or not (`turning_dmp`)."""
    chosen = {
        "dmp": DMPS,
        "dividing_dmp": [dmp for dmp in DMPS if dmp.system.divides_by_amplitude],
        "turning_dmp": [dmp for dmp in DMPS if not dmp.system.divides_by_amplitude],
    }
    for argument in chosen.keys() & set(metafunc.fixturenames):
        metafunc.parametrize(argument, chosen[argument], ids=_name)


@pytest.fixture(scope="session")
def features():
    """The three features and the path of one batch, by name."""

    def of(primitives):
        return {
            "weights": primitives.weights,
            "forcing": primitives.forcing(30),
            "shape-attractor": primitives.shape_attractor(30),
        }

    return of
