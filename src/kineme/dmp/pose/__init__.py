"""Orientations as unit quaternions (w, x, y, z), and poses."""
