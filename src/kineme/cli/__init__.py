"""The command line: parse, call, print."""

from kineme.cli.main import main

__all__ = ["main"]
