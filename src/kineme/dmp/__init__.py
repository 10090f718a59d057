"""Dynamical Movement Primitives: discrete, rhythmic, of poses; styles, generation, control."""
