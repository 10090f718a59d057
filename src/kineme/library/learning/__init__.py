"""Movements and files into the database."""
