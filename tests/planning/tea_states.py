"""A world of tea that tests share: states before and after, as sensors would tell them, and what is true of them."""

from __future__ import annotations

import numpy as np

from kineme.planning.operators import operators_of
from kineme.planning.states import States

PLACES = {"jar": (0.1, 0.2), "cup": (0.6, 0.1), "mug": (0.8, 0.1), "home": (0.0, 0.5)}
COLUMNS = (
    "hand_x", "hand_z", "jar_x", "jar_z", "cup_x", "cup_z", "mug_x", "mug_z", "spoon_full", "cup_sweet", "mug_sweet",
)  # fmt: skip
#: A session: symbol, where the hand begins, and where it ends.
SESSION = [
    ("reach", "home", "jar"), ("scoop", "jar", "jar"), ("carry", "jar", "cup"), ("stir", "cup", "cup"),
    ("reach", "cup", "jar"), ("scoop", "jar", "jar"), ("carry", "jar", "mug"), ("stir", "mug", "mug"),
]  # fmt: skip
#: What is true: operator -> preconditions and effects.
TRUE = {
    "reach": ({"(hand-at ?from)", "(not (hand-at ?to))", "(not (spoon_full))", "(not (sweet ?to))"},
              {"(not (hand-at ?from))", "(hand-at ?to)"}),
    "scoop": ({"(hand-at ?at)", "(not (spoon_full))", "(not (sweet ?at))"}, {"(spoon_full)"}),
    "carry": ({"(hand-at ?from)", "(not (hand-at ?to))", "(spoon_full)", "(not (sweet ?from))", "(not (sweet ?to))"},
              {"(not (hand-at ?from))", "(hand-at ?to)"}),
    "stir": ({"(hand-at ?at)", "(spoon_full)", "(not (sweet ?at))"}, {"(not (spoon_full))", "(sweet ?at)"}),
}  # fmt: skip


def states(sessions: int = 6, seed: int = 0) -> States:
    """States of some sessions; things stand elsewhere in each."""
    random = np.random.default_rng(seed)
    before, after, symbols = [], [], []
    for _ in range(sessions):
        shift, flags = random.normal(0, 0.05, 2), np.zeros(3)
        for symbol, start, goal in SESSION:
            for place, moment in ((start, before), (goal, after)):
                if moment is after:
                    flags = _flags(symbol, goal, flags)
                hand = np.array(PLACES[place]) + shift + random.normal(0, 0.01, 2)
                things = [np.array(PLACES[name]) + shift for name in ("jar", "cup", "mug")]
                moment.append(np.concatenate((hand, *things, flags)))
            symbols.append(symbol)
    return States(np.arange(len(symbols)), tuple(symbols), ("x", "z"), COLUMNS, np.array(before), np.array(after), {})


def _flags(symbol: str, goal: str, flags: np.ndarray) -> np.ndarray:
    flags = flags.copy()
    if symbol == "scoop":
        flags[0] = 1
    if symbol == "stir":
        flags[0], flags[1 if goal == "cup" else 2] = 0, 1
    return flags


def domain(sessions: int = 6, **options):
    """The domain of these states."""
    some = states(sessions)
    return operators_of(some, np.full(len(some), 2.0), {}, **options)


def now(**changes: float) -> dict[str, float]:
    """A state: everything in its place, the hand at home."""
    values = [*PLACES["home"], *PLACES["jar"], *PLACES["cup"], *PLACES["mug"], 0, 0, 0]
    return dict(zip(COLUMNS, map(float, values), strict=True)) | changes


def literals(operator) -> tuple[set[str], set[str]]:
    """Preconditions and effects as text."""
    return {*map(str, operator.preconditions)}, {*map(str, operator.effects)}
