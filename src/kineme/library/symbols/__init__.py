"""Symbols of a library: proposals, grounding and reports."""
