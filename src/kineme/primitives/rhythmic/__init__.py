"""Rhythmic DMPs: find the period, fold the recording into one cycle, learn a limit cycle, move on for ever."""
