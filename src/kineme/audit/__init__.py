"""What is wrong with the episodes of a set of robot data: checks, their calibration, a report, what to keep."""
