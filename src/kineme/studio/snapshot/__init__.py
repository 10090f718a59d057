"""A library as arrays and JSON that a browser computes with."""
