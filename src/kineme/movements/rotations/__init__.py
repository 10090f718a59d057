"""Unit quaternions and rotation vectors."""
