"""Cutting one continuous recording into movements."""
