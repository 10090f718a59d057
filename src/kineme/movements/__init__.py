"""Movements: trajectories, their preparation, and the segmentation of long recordings."""
