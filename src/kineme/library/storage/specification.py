"""The specification of a library's features and primitives: fixed when it is created, stored as plain data."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kineme.comparison.normalization import Normalization
from kineme.comparison.representation import DEFAULT_REPRESENTATIONS, Representation, check_representations
from kineme.comparison.specification import ComparisonSpecification
from kineme.errors import DataError, KinemeError, SpecificationError
from kineme.library.storage.rows import parsed
from kineme.movements.preparation.smooth import Smooth
from kineme.primitives.discrete.dmp import DMP
from kineme.primitives.persistence import specification_from_dict, specification_to_dict
from kineme.validation import check_choice, check_number

if TYPE_CHECKING:
    from kineme.recognition.recognizer import Recognizer

_MOST = 100_000  # dimensions


@dataclass(frozen=True)
class Specification:
    """How the movements of a library are described and compared, and how primitives are learned.

    The fields are the parameters of `kineme.Recognizer` that features and comparisons depend on, and `dmp`.
    """

    representations: tuple[Representation, ...] = DEFAULT_REPRESENTATIONS
    max_angle: float | None = None
    scale: str = "path"
    translation: bool = True
    cutoff: float | None = 10.0
    mean: str = "arithmetic"
    classifier: str = "auto"
    weights: str | tuple[float, ...] = "auto"
    dmp: DMP = field(default_factory=DMP)

    @classmethod
    def of(cls, recognizer: Recognizer | None, dmp: DMP | None) -> Specification:
        """From a recognizer, fitted or not, and a DMP; None for the defaults.

        Raises
        ------
        SpecificationError
            A parameter of the recognizer that no movement could be recognized with.
        """
        names = {one.name for one in fields(cls)} - {"dmp"}
        chosen: dict[str, Any] = {} if recognizer is None else {name: getattr(recognizer, name) for name in names}
        given = chosen.get("representations")
        chosen["representations"] = DEFAULT_REPRESENTATIONS if given is None else check_representations(given)
        if not isinstance(weights := chosen.get("weights", "auto"), str):
            chosen["weights"] = tuple(map(float, weights))
        made = cls(**chosen, dmp=dmp or DMP())
        made.check()
        return made

    @property
    def normalization(self) -> Normalization:
        """The normalization of position and size."""
        return Normalization(self.translation, self.scale)

    @property
    def comparison(self) -> ComparisonSpecification:
        """How movements are described and compared."""
        return ComparisonSpecification(self.representations, self.normalization, self.cutoff, self.max_angle, self.mean)

    def widths(self, n_dims: int) -> tuple[int, ...]:
        """Row length of each representation."""
        return tuple(n_dims * one.n_points for one in self.representations)

    def recognizer(self) -> Recognizer:
        """An unfitted recognizer with this specification."""
        from kineme.recognition.recognizer import Recognizer

        return Recognizer(**{field.name: getattr(self, field.name) for field in fields(self) if field.name != "dmp"})

    def to_json(self) -> dict[str, str]:
        """Two documents: ``recognizer`` and ``dmp``."""
        recognizer = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "dmp"}
        recognizer["representations"] = [asdict(one) for one in self.representations]
        return {"recognizer": json.dumps(recognizer), "dmp": json.dumps(specification_to_dict(self.dmp))}

    @classmethod
    def from_json(cls, meta: dict[str, str], path: Path) -> Specification:
        """The specification from `to_json` in the library at `path`; every parameter is checked like user input."""
        try:
            recognizer, dmp = parsed(meta["recognizer"]), parsed(meta["dmp"])
            recognizer["representations"] = tuple(Representation(**one) for one in recognizer["representations"])
            if isinstance(weights := recognizer.get("weights"), list):
                recognizer["weights"] = tuple(map(float, weights))
            made = cls(**recognizer, dmp=specification_from_dict(DMP, dmp))
            made.check()
        except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
            reason = error if isinstance(error, KinemeError) else f"{type(error).__name__}: {error}"
            raise DataError(
                f"expected {path} to contain the specification of its movements, got one that does not fit ({reason}); "
                "take the file from a backup or an export that you trust"
            ) from error
        return made

    def check(self) -> None:
        """Refuse invalid parameters of a recognizer; representations and the DMP check themselves."""
        check_representations(self.representations)
        _ = self.normalization  # checks translation and scale
        if self.max_angle is not None:
            check_number("max_angle", self.max_angle, least=0.0)
        if self.cutoff is not None:
            Smooth(self.cutoff)  # checks its own parameter
        self._check_choices()

    def _check_choices(self) -> None:
        from kineme.comparison.averages import LOG_MEANS
        from kineme.recognition.classifiers import CLASSIFIERS

        check_choice("mean", self.mean, list(LOG_MEANS))
        check_choice("classifier", self.classifier, ["auto", *CLASSIFIERS])
        if isinstance(self.weights, str):
            check_choice("weights", self.weights, ["auto", "equal"])
        elif len(self.weights) != len(self.representations):
            raise SpecificationError(f"expected {len(self.representations)} weights, got {len(self.weights)}")
        else:
            for weight in self.weights:
                check_number("weights", weight, least=0.0)


def as_n_dims(text: str, path: Path) -> int:
    """The number of dimensions from the stored text in the library at `path`."""
    if not (text.isascii() and text.isdecimal() and len(text) <= len(str(_MOST)) and 0 < int(text) <= _MOST):
        raise DataError(
            f"expected {path} to say how many dimensions its movements have, from 1 to {_MOST}, got {text[:40]!r}; "
            "take the file from a backup or an export that you trust"
        )
    return int(text)
