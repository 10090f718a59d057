"""Recordings in: formats by the names of files, checks, columns in one order, labels, many files as one set."""
