"""Unit quaternions, rotation vectors and rotation matrices."""
