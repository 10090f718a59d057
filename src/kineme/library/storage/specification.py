"""The specification of a library's features and primitives: fixed when it is created, stored as plain data."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from kineme.dmp.batch import specification_from_dict, specification_to_dict
from kineme.dmp.discrete.dmp import DMP
from kineme.errors import DataError, KinemeError, SpecificationError
from kineme.kernels.rotation import RotationPrior
from kineme.library.storage.rows import parsed
from kineme.similarity import specification as compared
from kineme.similarity.similarity import WEIGHTS
from kineme.validation import check_choice, check_number

if TYPE_CHECKING:
    from kineme.recognition.recognizer import Recognizer

_MOST = 100_000  # dimensions


class Recognizes(compared.Compares, Protocol):
    """A `kineme.Recognizer`, fitted or not, as far as a library keeps it."""

    classifier: str
    weights: str | Sequence[float]


@dataclass(frozen=True)
class Specification:
    """Specification of how the movements of a library are compared and recognized, and how they move again."""

    comparison: compared.ComparisonSpecification = field(default_factory=compared.ComparisonSpecification)
    classifier: str = "auto"  # this and the weights of the representations as of `kineme.Recognizer`
    weights: str | tuple[float, ...] = "auto"
    dmp: DMP = field(default_factory=DMP)  # of the primitives

    def __post_init__(self) -> None:
        from kineme.recognition.classifiers import CLASSIFIERS

        check_choice("classifier", self.classifier, ["auto", *CLASSIFIERS])
        if isinstance(self.weights, str):
            check_choice("weights", self.weights, list(WEIGHTS))
        elif len(self.weights) != len(self.representations):
            raise SpecificationError(f"expected {len(self.representations)} weights, got {len(self.weights)}")
        else:
            for weight in self.weights:
                check_number("weights", weight, least=0.0)

    @classmethod
    def of(cls, recognizer: Recognizes | None, dmp: DMP | None, default: Specification | None = None) -> Specification:
        """Make one from a recognizer and a DMP; None for those of the default."""
        default = cls() if default is None else default
        dmp = default.dmp if dmp is None else dmp
        if recognizer is None:
            return cls(default.comparison, default.classifier, default.weights, dmp)
        weights = recognizer.weights
        plain = weights if isinstance(weights, str) else tuple(map(float, weights))
        return cls(recognizer.specification, recognizer.classifier, plain, dmp)

    @property
    def representations(self) -> tuple[compared.Representation, ...]:
        """The representations that movements are compared in; features of those by pairs are made from stored ones."""
        return self.comparison.representations

    def widths(self, n_dims: int) -> tuple[int, ...]:
        """Return numbers per movement in each of the stored rows, see `ComparisonSpecification.stored_rows`."""
        return tuple(n_dims * representation.n_points for representation in self.comparison.stored_rows)

    def recognizer(self) -> Recognizer:
        """Return a recognizer, not fitted, that compares and recognizes movements in this way."""
        from kineme.recognition.recognizer import Recognizer

        return Recognizer(**self._parameters())

    def _parameters(self) -> dict[str, Any]:
        how = self.comparison
        return {
            "representations": how.representations,
            "max_angle": how.max_angle,
            "scale": how.normalization.scale,
            "translation": how.normalization.translation,
            "cutoff": how.cutoff,
            "mean": how.mean,
            "classifier": self.classifier,
            "weights": self.weights,
            "rotation_prior": how.prior,
            "points": how.points,
        }

    def to_json(self) -> dict[str, str]:
        """Return two documents: ``recognizer`` and ``dmp``."""
        prior = self.comparison.prior
        parameters = self._parameters() | {
            "representations": [asdict(representation) for representation in self.representations],
            "rotation_prior": None if prior is None else asdict(prior),
        }
        return {"recognizer": json.dumps(parameters), "dmp": json.dumps(specification_to_dict(self.dmp))}

    @classmethod
    def from_json(cls, meta: dict[str, str], path: Path) -> Specification:
        """Read what `to_json` wrote into the library at `path`; parameters are checked as if a user had typed them."""
        try:
            return _of_texts(meta["recognizer"], meta["dmp"])
        except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
            reason = error if isinstance(error, KinemeError) else f"{type(error).__name__}: {error}"
            raise DataError(
                f"expected {path} to say how its movements are described, got a specification that does not fit "
                f"({reason}); take the file from a backup or an export that you trust"
            ) from error


@lru_cache(maxsize=16)  # a library is opened again and again
def _of_texts(recognizer: str, dmp_text: str) -> Specification:
    parameters, dmp = parsed(recognizer), parsed(dmp_text)
    # Before there were signals, all movements were described as paths, and "auto" took the representations' weights.
    before = any("signal" not in fields for fields in parameters["representations"])
    if before and parameters.get("weights", "auto") == "auto":
        parameters["weights"] = "own"
    own = (compared.Representation(**{"signal": False} | fields) for fields in parameters["representations"])
    parameters["representations"] = tuple(own)
    if (prior := parameters.get("rotation_prior")) is not None:
        vertical = None if prior["vertical"] is None else tuple(prior["vertical"])
        parameters["rotation_prior"] = RotationPrior(**prior | {"vertical": vertical})
    if not isinstance(weights := parameters.get("weights", "auto"), str):
        parameters["weights"] = tuple(map(float, weights))
    normalization = compared.Normalization(parameters.pop("translation", True), parameters.pop("scale", "path"))
    comparison = compared.ComparisonSpecification(
        parameters.pop("representations", compared.ROW_REPRESENTATIONS),
        normalization,
        parameters.pop("cutoff", 10.0),
        parameters.pop("max_angle", None),
        parameters.pop("mean", "arithmetic"),
        parameters.pop("rotation_prior", None),
        parameters.pop("points", 1),  # of libraries that do not say it, no columns turn together
    )
    return Specification(comparison, dmp=specification_from_dict(DMP, dmp), **parameters)


def as_n_dims(text: str, path: Path) -> int:
    """Return the number of dimensions from the stored text in the library at `path`."""
    if not (text.isascii() and text.isdecimal() and len(text) <= len(str(_MOST)) and 0 < int(text) <= _MOST):
        raise DataError(
            f"expected {path} to say how many dimensions its movements have, from 1 to {_MOST}, got {text[:40]!r}; "
            "take the file from a backup or an export that you trust"
        )
    return int(text)
