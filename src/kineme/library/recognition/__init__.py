"""Recognizing with the movements of a library."""
