"""Comparing movements: representations, normalization, averaged kernel, widths, alignment, bounds."""
