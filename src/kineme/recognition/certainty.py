"""How sure an answer is, in one of four words: the same in Python, in the shell, in the studio and on its page."""

from __future__ import annotations

from types import MappingProxyType
from typing import Literal

Certainty = Literal["sure", "probably", "looks like", "new"]

#: Word -> the least confidence that it takes. The guide to recognition has the shares of right answers by word.
LEAST_CONFIDENCE = MappingProxyType({"sure": 0.999, "probably": 0.99})


def certainty(confidence: float, *, is_new: bool, is_guess: bool, is_over: bool = True) -> Certainty:
    """How sure it is that a movement is of the class that is said.

    Parameters
    ----------
    confidence : float
        Probability of that class if the movement is of a known one.
    is_new : bool
        Whether the movement is unlike every known class.
    is_guess : bool
        Whether too few demonstrations tell what is unlike them: the answer then is what the movement looks like.
    is_over : bool
        Whether the whole movement was seen. What is under way looks like a class, no more: it may go on otherwise.
    """
    if is_new:
        return "new"
    if is_guess or not is_over or confidence < LEAST_CONFIDENCE["probably"]:
        return "looks like"
    return "sure" if confidence >= LEAST_CONFIDENCE["sure"] else "probably"


def in_words(word: Certainty, name: str, most_like: str) -> str:
    """The word with the name that it is about: of what is new, that which it is most like."""
    return f"new, most like {most_like}" if word == "new" else f"{word} {name}"
