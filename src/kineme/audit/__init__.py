"""Faults of the episodes in a set of robot data: checks, their calibration, a report, the episodes to keep."""
