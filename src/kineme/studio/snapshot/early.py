"""What recognizes a movement under way, as plain data: the runtime computes the beginnings from the paths."""

from __future__ import annotations

import math
from typing import Any

from kineme.recognition.early.hypotheses import Early, hypotheses
from kineme.recognition.known_classes import KnownClasses
from kineme.studio.snapshot.recognition import pair_rule, rotation_rule

#: How the studio and its page recognize movements under way. People draw on a screen faster or slower than they showed:
#: with 1.0 a factor of 7 either way is two standard deviations. Of 150 letters of 26 (letters2d, two of each in the
#: library) drawn twice as fast 76 in 100 were decided rightly by their end instead of 49, half as fast 74 instead of
#: 55, and as fast as in the library 78 instead of 81.
DRAWN = Early(duration_spread=1.0)


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
