"""Movements and annotations out, each file written whole or not at all."""
