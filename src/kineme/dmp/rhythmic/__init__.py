"""Rhythmic DMPs: estimate the period, fold the recording into one cycle, learn a limit cycle, generate movements."""
