"""Movements: what they are, how they are prepared, cut and inspected."""
