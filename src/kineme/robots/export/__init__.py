"""Joint trajectories in the formats that robots and their programs take."""
