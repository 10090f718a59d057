"""Many demonstrations: average, spread and styles; public names of `kineme.primitives.styles`."""

from kineme.primitives.styles import (
    AveragePrimitive,
    StyleEstimate,
    StyleModel,
    average,
    average_by_label,
    learn_styles,
)

__all__ = ["AveragePrimitive", "StyleEstimate", "StyleModel", "average", "average_by_label", "learn_styles"]
