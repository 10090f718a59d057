"""Trajectories: one movement, many movements, and the steps that prepare them."""
