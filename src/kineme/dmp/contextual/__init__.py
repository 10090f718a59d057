"""Movements as a function of the task: primitives for parameters between those that were demonstrated."""
