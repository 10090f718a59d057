"""What is checked before a trajectory is written."""
