"""Recordings of motion capture systems: the heads of their text exports, BVH and C3D."""
