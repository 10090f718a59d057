"""Properties of policy improvement are stated once and run over every formulation."""

from __future__ import annotations

from kineme import DMP
from kineme.dmp.discrete.specification import FORMULATIONS


def pytest_generate_tests(metafunc):
    if "dmp" in metafunc.fixturenames:
        dmps = [DMP(formulation, n_basis=20, n_points=80) for formulation in FORMULATIONS]
        metafunc.parametrize("dmp", dmps, ids=list(FORMULATIONS))
