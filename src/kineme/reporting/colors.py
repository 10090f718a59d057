"""Okabe and Ito's palette, which color-blind readers can tell apart, from dark to light."""

from __future__ import annotations

BLUE, ORANGE, GREEN, PURPLE, GRAY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#777777"
