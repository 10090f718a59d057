"""What a set of recordings holds: counts, durations, rates, gaps, problems, and a picture."""
