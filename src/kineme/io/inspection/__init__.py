"""Summaries of a set of recordings: counts, durations, rates, gaps, problems, and a figure."""
