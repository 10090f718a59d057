"""Dynamical Movement Primitives: phase, basis, formulation, fit; encode and decode as matrix products."""
