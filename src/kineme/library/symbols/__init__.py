"""Symbols of a library: proposals, grounding, reports."""
