"""Proposals of symbols for a person to name, and how they change."""
