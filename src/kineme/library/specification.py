"""What the features and primitives of a library mean: fixed when it is made, kept with it as data."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any

from kineme.errors import DataError, KinemeError
from kineme.primitives.dmp import DMP
from kineme.primitives.persistence import specification_from_dict, specification_to_dict
from kineme.recognition.normalization import Normalization
from kineme.recognition.representation import DEFAULT_REPRESENTATIONS, Representation

if TYPE_CHECKING:
    from kineme.recognition.recognizer import Recognizer

_MOST = 100_000  # dimensions, points, basis functions: of more, one matrix would not fit into any memory

#: The primitives of a library: a fit of the path itself, which replays what was shown.
DEFAULT_DMP = DMP("bio-inspired", fit="trajectory", n_basis=40)


@dataclass(frozen=True)
class Specification:
    """How the movements of a library are seen, and how they move again.

    The fields are the parameters of `kineme.Recognizer` that features depend on, those of its comparison, and `dmp`.
    """

    representations: tuple[Representation, ...] = DEFAULT_REPRESENTATIONS
    max_angle: float | None = None
    scale: str = "path"
    translation: bool = True
    cutoff: float | None = 10.0
    mean: str = "arithmetic"
    classifier: str = "auto"
    weights: str | tuple[float, ...] = "auto"
    dmp: DMP = DEFAULT_DMP

    @classmethod
    def of(cls, recognizer: Recognizer | None, dmp: DMP | None) -> Specification:
        """From a recognizer, fitted or not, and a DMP; None for the defaults."""
        names = {one.name for one in fields(cls)} - {"dmp"}
        chosen: dict[str, Any] = {} if recognizer is None else {name: getattr(recognizer, name) for name in names}
        chosen["representations"] = tuple(chosen.get("representations") or DEFAULT_REPRESENTATIONS)
        if not isinstance(weights := chosen.get("weights", "auto"), str):
            chosen["weights"] = tuple(map(float, weights))
        return cls(**chosen, dmp=dmp or DEFAULT_DMP)

    @property
    def normalization(self) -> Normalization:
        """What is taken out of place and size."""
        return Normalization(self.translation, self.scale)

    def widths(self, n_dims: int) -> tuple[int, ...]:
        """Numbers per movement in the rows of each representation."""
        return tuple(n_dims * one.n_points for one in self.representations)

    def recognizer(self) -> Recognizer:
        """A recognizer, not fitted, that sees movements in this way."""
        from kineme.recognition.recognizer import Recognizer

        return Recognizer(**{field.name: getattr(self, field.name) for field in fields(self) if field.name != "dmp"})

    def to_json(self) -> dict[str, str]:
        """Two documents: ``recognizer`` and ``dmp``."""
        seen = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "dmp"}
        seen["representations"] = [asdict(one) for one in self.representations]
        return {"recognizer": json.dumps(seen), "dmp": json.dumps(specification_to_dict(self.dmp))}

    @classmethod
    def from_json(cls, meta: dict[str, str]) -> Specification:
        """What `to_json` wrote; every parameter is checked as if a user had typed it."""
        try:
            seen = json.loads(meta["recognizer"])
            seen["representations"] = tuple(Representation(**one) for one in seen["representations"])
            if isinstance(weights := seen.get("weights"), list):
                seen["weights"] = tuple(map(float, weights))
            return cls(**seen, dmp=specification_from_dict(DMP, json.loads(meta["dmp"])))
        except (KeyError, TypeError, ValueError) as error:
            reason = error if isinstance(error, KinemeError) else f"{type(error).__name__}: {error}"
            raise DataError(
                f"expected a library that says how its movements are seen, got a specification that does not fit "
                f"({reason}); take the file from a backup or an export"
            ) from error


def as_n_dims(text: str) -> int:
    """The number of dimensions, as a library keeps it."""
    if not (text.isascii() and text.isdecimal() and len(text) <= len(str(_MOST)) and 0 < int(text) <= _MOST):
        raise DataError(
            f"expected a library that says how many dimensions its movements have, from 1 to {_MOST}, got "
            f"{text[:40]!r}; take the file from a backup or an export that you trust"
        )
    return int(text)
