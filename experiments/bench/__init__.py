"""Timings and errors of kineme beside its peers; run `python -m bench`."""
