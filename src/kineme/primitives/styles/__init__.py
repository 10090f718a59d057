"""Many demonstrations of one movement: their average with its spread, and the styles in which they differ."""

from kineme.primitives.styles.average import AveragePrimitive, average, average_by_label
from kineme.primitives.styles.learn import learn_styles
from kineme.primitives.styles.model import StyleEstimate, StyleModel

__all__ = ["AveragePrimitive", "StyleEstimate", "StyleModel", "average", "average_by_label", "learn_styles"]
