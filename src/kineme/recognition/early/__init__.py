"""Recognizing a movement of which only the beginning is given."""
