"""The command line: parse options, call the library, print results."""

from kineme.cli.main import main

__all__ = ["main"]
