"""``python -m kineme`` is the command ``kineme``."""

from kineme.cli import main

main(prog_name="kineme")
