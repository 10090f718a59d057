"""Movements under way, recognized with what a library holds."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.answer import Answer
from kineme.recognition.early.decision import Decision
from kineme.recognition.early.hypotheses import Early, Hypotheses, hypotheses
from kineme.recognition.early.stream import Live
from kineme.recognition.known_classes import KnownClasses


class Begun(NamedTuple):
    """The beginnings of the movements of one version; any number of streams share them."""

    version: int
    early: Early
    known: KnownClasses
    hypotheses: Hypotheses


def begun(version: int, known: KnownClasses, early: Early) -> Begun:
    """Prepare the beginnings of known movements."""
    return Begun(version, early, known, hypotheses(known.comparison, known.references, early))


def live(shared: Begun, confidence: float, patience: float, recognize: Callable[[Trajectory], Answer]) -> Live:
    """A stream; `recognize` answers to the whole movement at its end."""
    known = shared.known
    return Live(known.comparison, known.references, shared.hypotheses, Decision(confidence, patience), recognize)
