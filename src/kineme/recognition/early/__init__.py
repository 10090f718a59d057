"""Recognizing a movement of which only the beginning has been seen."""
