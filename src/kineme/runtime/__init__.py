"""Means of computing: compiled loops or their NumPy twins, threads over tiles, forks."""
