"""How work is done: compiled loops or their NumPy twins, threads over tiles, forks."""
