"""Discrete DMPs: phase, basis, formulation, fit; encode and decode as matrix products."""
