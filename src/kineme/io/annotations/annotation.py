"""The record of what happens when in a recording."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Annotation:
    """A stretch of motion in a recording, and the symbol that it shows.

    Attributes
    ----------
    recording : str
        The recording, as `kineme.io.merge_files.Source.path` names it.
    place : str
        Which movement of the file, such as the number of an episode; empty if the file holds but one.
    start, end : float
        Time stamps of the first and the last sample [s], by the clock of the recording.
    symbol : str or None
        None: motion that is like no symbol.
    p_value : float
        Share of movements of known symbols that would be as novel or more, see `kineme.recognition.answer.Answer`.
    confidence : float
        Probability that the symbol is right if the movement is one of the library's; if unknown, 1 minus `p_value`.
    origin : float
        Time stamp of the first sample of the recording [s].
    """

    recording: str
    place: str
    start: float
    end: float
    symbol: str | None
    p_value: float
    confidence: float
    origin: float = 0.0

    @property
    def unknown(self) -> bool:
        """Whether the motion is like no symbol."""
        return self.symbol is None

    @property
    def span(self) -> tuple[float, float]:
        """Start and end in seconds since the first sample, as programs for videos count them."""
        return self.start - self.origin, self.end - self.origin
