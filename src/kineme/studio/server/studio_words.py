"""What refusals say to do, in the words of the studio: they name choices of the library and of the shell."""

from __future__ import annotations

import re

# Bounded where they repeat: texts hold the names of other people's files and columns, of any length.
_CHANNELS = r"(?:choose|select) the (?:columns|dimensions)\b.{0,80}?in the shell (?:with )?--columns(?: and --kind)?"
_SMALLER = "make the movement smaller"
_WORDS = tuple(
    (re.compile(library), studio)
    for library, studio in (
        (_CHANNELS, "choose other channels"),
        (
            r"choose columns, or say that it is a movement of the joints \(joints=True, --joints\)",
            "make a library of movements in the plane or in space; if these move the joints of an arm, execute them in "
            "the shell: kineme move with --joints",
        ),
        (r"choose another place \(--at\), free the orientation .{0,80}\(--scale\)", _SMALLER),
        (r"is the movement in millimeters\? --scale 0\.001 makes it meters", _SMALLER),
        (r"choose another place \(--at\), orientation .{0,80}\(--rest\)", f"{_SMALLER}, or choose another arm"),
        (
            r"choose another goal \(--goal\) or start \(--at\) of the joints",
            "drag the goal in Move, or choose another arm",
        ),
        (r"slow it down \(timing='slowed', --slow-down\)", "tick 'Slow down where limits need it'"),
        (
            r"; [^;]*\bin the shell (?:with )?(--.*)",
            r"; change the file, or learn it in the shell: kineme learn with \1",
        ),
        (r"\((?:choose with )?\w{1,20}=[^()]{0,20}, (--[\w-]+)\)", r"(in the shell \1)"),
    )
)


def in_studio_words(text: str) -> str:
    """A refusal, with what can be done about it in the studio, or where else."""
    for library, studio in _WORDS:
        text = library.sub(studio, text)
    return text
