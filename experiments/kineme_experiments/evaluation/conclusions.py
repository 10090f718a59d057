"""What the results say in sentences: where a rival is ahead, and whether all rivals ran."""

from __future__ import annotations

from statistics import fmean
from typing import NamedTuple

from kineme.reporting.text import counted
from kineme_experiments.evaluation.conditions import Condition
from kineme_experiments.evaluation.methods import METHODS, OURS
from kineme_experiments.evaluation.protocols import PROTOCOLS
from kineme_experiments.evaluation.results import Results
from kineme_experiments.evaluation.trials import TASKS

#: Measure -> its name in tables.
MEASURES = {
    "accuracy": "accuracy",
    "auroc": "AUROC",
    "rejected": "unknown rejected",
    "precision": "precision",
    "recall": "recall",
    "adjusted_rand": "adjusted Rand",
    "adjusted_rand_given": "adjusted Rand, number given",
    "clusters": "clusters per class",
}
_NOT_RANKED = {"clusters"}  # 1 is best


class Ahead(NamedTuple):
    """A cell of a table in which a rival's mean is above ours, in three digits."""

    protocol: str
    rival: str
    condition: Condition
    measure: str
    theirs: float
    ours: float


def columns(protocol: str, results: Results) -> list[tuple[Condition, str]]:
    """Conditions and measures of a protocol in their order, of all methods together."""
    outcomes = results.outcomes[protocol].values()
    return [
        (condition, measure)
        for condition in results.conditions(protocol)
        for measure in dict.fromkeys(m for outcome in outcomes for m in outcome.get(condition, {}))
    ]


def cells_ahead(protocol: str, results: Results) -> list[Ahead]:
    """All cells in which a rival is ahead."""
    ahead = []
    for condition, measure in columns(protocol, results):
        ours = results.mean(protocol, OURS, condition, measure)
        if ours is None or measure in _NOT_RANKED:
            continue
        for rival in results.outcomes[protocol]:
            theirs = results.mean(protocol, rival, condition, measure)
            if rival != OURS and theirs is not None and round(theirs, 3) > round(ours, 3):
                ahead.append(Ahead(protocol, rival, condition, measure, theirs, ours))
    return ahead


def missing(protocol: str, results: Results) -> dict[str, str]:
    """The rivals that did not take part, with the reason."""
    absent = [name for name in METHODS if name != OURS and name not in results.outcomes[protocol]]
    return {name: results.absent.get(name) or _cannot(protocol, results, name) for name in absent}


def _cannot(protocol: str, results: Results, name: str) -> str:
    elsewhere = any(name in by_method for by_method in results.outcomes.values())
    return _cannot_do(protocol) if elsewhere else "not asked for"


def _cannot_do(protocol: str) -> str:
    return f"cannot {TASKS[PROTOCOLS[protocol].task].words}"


def conclusion(protocol: str, results: Results) -> str:
    """Where a rival is ahead in a table, among the rivals that took part; and which rivals did not, and why."""
    if OURS not in results.outcomes[protocol]:
        return ""
    absent = missing(protocol, results)
    listed = _not_compared(protocol, absent)
    rivals = [METHODS[name].title for name in results.outcomes[protocol] if name != OURS]
    if not rivals:
        return f"No rival took part. {listed}".rstrip()
    if ahead := cells_ahead(protocol, results):
        cells = dict.fromkeys((one.condition, one.measure) for one in ahead)
        named = "; ".join(_cell([one for one in ahead if (one.condition, one.measure) == cell]) for cell in cells)
        return f"Ahead of kineme: {named}. {listed}".rstrip()
    none = "None of the rivals that took part is" if absent else "No rival is"
    return f"{none} ahead of kineme in this table. Rivals here: {'; '.join(rivals)}. {listed}".rstrip()


def _not_compared(protocol: str, absent: dict[str, str]) -> str:
    """The rivals that did not take part; those that cannot do what the protocol asks as one."""
    cannot = _cannot_do(protocol)
    others = {name: why for name, why in absent.items() if why != cannot}
    parts = [f"Not compared: {_with_reasons(others)}."] if others else []
    if len(others) < len(absent):
        who = "The other rivals" if len(absent) < len(METHODS) - 1 else "Rivals"
        parts.append(f"{who} {cannot}.")
    return " ".join(parts)


def _cell(ahead: list[Ahead]) -> str:
    """All rivals that are ahead in one cell, the first first."""
    one = ahead[0]
    what = "" if one.measure == "accuracy" else f", {MEASURES[one.measure]}"
    rivals = sorted(ahead, key=lambda each: -each.theirs)
    named = ", ".join(f"{METHODS[rival.rival].title} {rival.theirs:.3f}" for rival in rivals)
    return f"{one.condition.label}{what} ({one.ours:.3f}): {named}"


def verdict(results: Results) -> str:
    """Return what all tables say together, as one text."""
    return " ".join(sentences(results))


def sentences(results: Results) -> list[str]:
    """Say in how many cells a rival is ahead, and then which rivals did not run, and where none took part."""
    protocols = [name for name, by_method in results.outcomes.items() if OURS in by_method and len(by_method) > 1]
    if not protocols:
        return ["Nothing is concluded about rivals: in no table did kineme and a rival take part together."]
    ahead = {(name, one.condition, one.measure) for name in protocols for one in cells_ahead(name, results)}
    n_cells = sum(_n_compared(name, results) for name in protocols)
    absent = {
        name: why
        for protocol in protocols
        for name, why in missing(protocol, results).items()
        if why != _cannot_do(protocol)
    }
    alone = [PROTOCOLS[name].title for name, by_method in results.outcomes.items() if set(by_method) == {OURS}]
    if ahead:
        parts = [f"A rival is ahead of kineme in {len(ahead)} of {n_cells} cells; each table lists its own."]
    else:
        who = "None of the rivals that took part is" if absent else "No rival is"
        parts = [f"{who} ahead of kineme in any of {n_cells} cells."]
    if absent:
        parts.append(f"Not all rivals ran everywhere: {_with_reasons(absent)}.")
    if alone:
        parts.append(f"No rival took part in: {'; '.join(alone)}.")
    return parts


def best_rival(results: Results) -> str:
    """Name the rival with the smallest mean lag, and both means over the cells that both have."""
    pairs: dict[str, list[tuple[float, float]]] = {}
    for protocol, by_method in results.outcomes.items():
        for condition, measure in columns(protocol, results) if OURS in by_method else ():
            ours = results.mean(protocol, OURS, condition, measure)
            for rival in set(by_method) - {OURS}:
                theirs = results.mean(protocol, rival, condition, measure)
                if None not in (ours, theirs) and measure not in _NOT_RANKED:
                    pairs.setdefault(METHODS[rival].title, []).append((ours, theirs))  # type: ignore[arg-type]
    if not pairs:
        return ""
    means = {rival: tuple(map(fmean, zip(*both, strict=True))) for rival, both in pairs.items()}
    rival = min(sorted(means), key=lambda name: means[name][0] - means[name][1])
    ours, theirs = means[rival]
    cells = counted(len(pairs[rival]), "cell")
    return f"The best rival is {rival}: {theirs:.3f} on average over {cells}, where kineme has {ours:.3f}."


def _n_compared(protocol: str, results: Results) -> int:
    """Cells with a value of ours and of at least one rival."""
    return sum(
        results.mean(protocol, OURS, condition, measure) is not None
        and measure not in _NOT_RANKED
        and any(
            results.mean(protocol, rival, condition, measure) is not None
            for rival in results.outcomes[protocol]
            if rival != OURS
        )
        for condition, measure in columns(protocol, results)
    )


def _with_reasons(methods: dict[str, str]) -> str:
    return "; ".join(f"{METHODS[name].title} ({why})" for name, why in methods.items())
