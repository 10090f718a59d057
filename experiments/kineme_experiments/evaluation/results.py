"""All scores by protocol, method, condition and measure."""

from __future__ import annotations

from collections.abc import Mapping
from statistics import fmean
from typing import Any, NamedTuple

from kineme_experiments.evaluation.conditions import Condition
from kineme_experiments.evaluation.methods import METHODS
from kineme_experiments.evaluation.score_split import Scores

#: Condition -> measure -> value in each split.
Outcome = dict[Condition, dict[str, list[float]]]


class Results(NamedTuple):
    """Outcomes and seconds by protocol and method; methods and protocols that did not run, with reasons."""

    outcomes: dict[str, dict[str, Outcome]]
    spent: dict[str, dict[str, float]]
    absent: dict[str, str]
    skipped: dict[str, str]

    def mean(self, protocol: str, method: str, condition: Condition, measure: str) -> float | None:
        """Mean over splits; None if the method did not take part."""
        values = self.outcomes[protocol].get(method, {}).get(condition, {}).get(measure)
        return fmean(values) if values else None

    def conditions(self, protocol: str) -> list[Condition]:
        """All conditions of a protocol in their order, as listed by the method that took part in most of them."""
        return max((list(outcome) for outcome in self.outcomes[protocol].values()), key=len, default=[])

    def numbers(self) -> dict[str, Any]:
        """Everything but the seconds, for JSON; in six digits, which do not depend on the order of summation."""
        protocols = {
            protocol: {
                method: {
                    condition.label: {measure: _summary(values) for measure, values in measures.items()}
                    for condition, measures in outcome.items()
                }
                for method, outcome in by_method.items()
            }
            for protocol, by_method in self.outcomes.items()
        }
        return {"protocols": protocols, "absent_methods": self.absent, "skipped_protocols": self.skipped}

    def seconds(self) -> dict[str, dict[str, float]]:
        """Seconds to learn and to classify, all splits together, by protocol and method."""
        return {
            protocol: {method: round(value, 3) for method, value in by_method.items()}
            for protocol, by_method in self.spent.items()
        }


def collect(scores: Mapping[Any, list[Scores]], absent: dict[str, str], skipped: dict[str, str]) -> Results:
    """Merge the scores of all jobs; trials of one condition within a split, such as folds, are averaged.

    Parameters
    ----------
    scores : mapping
        (protocol, method, index of the split) -> scores, in the order of splits.
    """
    outcomes: dict[str, dict[str, Outcome]] = {}
    spent: dict[str, dict[str, float]] = {}
    order = {name: k for k, name in enumerate(METHODS)}
    for (protocol, method, _), own in sorted(scores.items(), key=lambda item: order[item[0][1]]):
        outcome = outcomes.setdefault(protocol, {}).setdefault(method, {})
        for condition, values in _averaged(own).items():
            for measure, value in values.items():
                outcome.setdefault(condition, {}).setdefault(measure, []).append(value)
        times = spent.setdefault(protocol, {})
        times[method] = times.get(method, 0.0) + sum(one.seconds for one in own)
    return Results(outcomes, spent, absent, skipped)


def _averaged(scores: list[Scores]) -> dict[Condition, dict[str, float]]:
    grouped: dict[Condition, list[dict[str, float]]] = {}
    for score in scores:
        grouped.setdefault(score.condition, []).append(score.values)
    return {
        condition: {measure: fmean(values[measure] for values in all_values) for measure in all_values[0]}
        for condition, all_values in grouped.items()
    }


def _summary(values: list[float]) -> dict[str, Any]:
    rounded = [float(f"{value:.6g}") for value in values]
    return {"mean": float(f"{fmean(values):.6g}"), "min": min(rounded), "max": max(rounded), "by_split": rounded}
