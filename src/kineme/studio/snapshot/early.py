"""What recognizes a movement under way, as plain data: the runtime computes the beginnings from the paths."""

from __future__ import annotations

import math
from typing import Any

from kineme.recognition.early.hypotheses import Early, hypotheses
from kineme.recognition.known_classes import KnownClasses
from kineme.studio.snapshot.recognition import pair_rule, rotation_rule


def early_part(known: KnownClasses, early: Early | None = None) -> dict[str, Any]:
    """Header of early recognition: spreads, rotations, widths, and how fast movements are at their end."""
    made = hypotheses(known.comparison, known.references, early or Early())
    spreads = {name: getattr(made.early, name) for name in ("size_spread", "duration_spread", "timing_spread")}
    assert made.described.pairs is not None
    return {
        "n_progress": made.early.n_progress,
        **{name: None if math.isinf(value) else value for name, value in spreads.items()},
        "own_rotations": made.early.max_angle is not None,
        "rule": rotation_rule(made.procrustes),
        "shapes": pair_rule(made.described.pairs.shapes),
        "widths": made.widths.tolist(),
        "over": list(made.ending.over),
        "before": list(made.ending.before),
    }
