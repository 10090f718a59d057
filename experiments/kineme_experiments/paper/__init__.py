"""The experiments, tables and figures of the paper, on real recordings."""
