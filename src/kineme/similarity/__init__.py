"""Comparison of movements: representations, descriptions, kernel widths, averaged kernel, alignment, bounds."""
