"""Anchoring: movements gathered into symbols, and symbols brought back to movements. Arrays in, records out."""
