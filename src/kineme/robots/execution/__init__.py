"""Timing, checks and the approach: what is sent to an arm."""
