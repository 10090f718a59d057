"""Poses of the tip to joint positions, over a whole movement."""
