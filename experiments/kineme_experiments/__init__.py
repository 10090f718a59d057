"""Experiments: the paper's, and recognizers side by side."""
