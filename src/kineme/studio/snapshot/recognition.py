"""What recognizes movements, as plain data and arrays: comparison, references, classifier and calibration."""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.kernels.procrustes import Procrustes
from kineme.kernels.shapes import Shapes
from kineme.movements.preparation import pauses
from kineme.movements.preparation.smooth import spline_matrix
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition import left_out
from kineme.recognition.certainty import LEAST_CONFIDENCE
from kineme.recognition.classifiers import Classifier, Nearest, NearestEach, Prototype
from kineme.recognition.conformal import GUESSES, Calibration
from kineme.recognition.early import evidence, prefixes
from kineme.recognition.early import hypotheses as beginnings
from kineme.recognition.early.hypotheses import Early, hypotheses
from kineme.recognition.known_classes import KnownClasses
from kineme.similarity.comparison import Comparison
from kineme.similarity.describe import N_POINTS, even_paths
from kineme.similarity.representation import PAIR_QUANTITIES, Representation, forcing_operator, rotating
from kineme.studio.snapshot.snapshot import Snapshot
from kineme.validation import Array

#: How the studio and its page recognize movements under way. People draw on a screen faster or slower than they showed:
#: with 1.0 a factor of 7 either way is two standard deviations. Of 150 letters of 26 (letters2d, two of each in the
#: library) drawn twice as fast 76 in 100 were decided rightly by their end instead of 49, half as fast 74 instead of
#: 55, and as fast as in the library 78 instead of 81.
DRAWN = Early(duration_spread=1.0)

#: What to do about a library whose recognizer the runtime does not have.
_AGAIN = (
    "learn the same movements in another library: other = ActionLibrary(folder, create=True, recognizer=Recognizer()), "
    "then other.learn(library.movements(symbol.name)) for every symbol in library.symbols()"
)


def recognition_parts(known: KnownClasses) -> Snapshot:
    """Header and arrays of what recognizes movements.

    Raises
    ------
    SpecificationError
        A classifier, or a limit of rotations in space, that the runtime does not have.
    """
    demos = known.references.all_movements()
    comparison, comparison_arrays = _comparison(known.comparison, known.references.described.pairs)
    calibration, calibration_arrays = _calibration(known.calibration)
    header = {
        "n_movements": len(known.references),
        "classes": [str(name) for name in known.references.classes.tolist()],
        "first": known.references.first.tolist(),
        "comparison": comparison,
        "calibration": calibration,
        "certainty": dict(LEAST_CONFIDENCE),
        **_classifier(known.classifier),
    }
    paths = even_paths(demos, 0, len(demos), known.comparison.cutoff)
    arrays: dict[str, NDArray[Any]] = {
        "paths": paths.astype(np.float32),
        "starts": _starts(demos),
        "durations": np.asarray((pauses.without_pauses(demos, 0, len(demos)) or demos).durations, dtype=np.float64),
        **comparison_arrays,
        **calibration_arrays,
    }
    return Snapshot(header, arrays)


def _starts(demos: Demonstrations) -> Array:
    return np.asarray(demos.positions[demos.offsets[:-1]], dtype=np.float64)


def _comparison(how: Comparison, pairs: Any) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    representations, similarity = how.representations, how.similarity
    by_rows = [representation for representation in representations if not representation.in_pairs]
    rows = []
    arrays: dict[str, NDArray[Any]] = {}
    for r, one in enumerate(by_rows):
        row, more = _row_representation(one, r)
        rows.append(row)
        arrays |= more
    n = len(representations)
    weights = np.full(n, 1.0 / n) if similarity.weights is None else similarity.weights
    header = {
        "n_dims": how.n_dims,
        "cutoff": how.cutoff,
        "translation": how.normalization.translation,
        "scale": how.normalization.scale,
        "pauses": pause_rule(),
        "mean": how.mean,
        "rule": rotation_rule(how.procrustes),
        "by_rows": rows,
        "by_pairs": [
            PAIR_QUANTITIES.index(representation.quantity) for representation in representations[len(by_rows) :]
        ],
        "rotating": rotating(representations) if pairs is not None else -1,
        "shapes": None if pairs is None else pair_rule(pairs.shapes),
        "widths": [float(width) if np.isfinite(width) else None for width in similarity.widths],
        "weights": weights.tolist(),
        "names": [representation.name for representation in representations],
    }
    return header, arrays


def _row_representation(one: Representation, r: int) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """What is compared sample by sample: its parameters, and the matrices that describing needs."""
    row: dict[str, Any] = {"quantity": one.quantity, "arc_share": one.arc_share, "n_points": one.n_points}
    arrays: dict[str, NDArray[Any]] = {}
    if one.quantity == "forcing":
        row["operator"] = f"operator {r}"
        arrays[row["operator"]] = forcing_operator(one, np.dtype(np.float32))
    if one.arc_share == 0 and (N_POINTS - 1) % (one.n_points - 1):
        row["resample"] = f"resample {r}"
        arrays[row["resample"]] = spline_matrix(N_POINTS, one.n_points)
    return row, arrays


def pause_rule() -> dict[str, float]:
    """Return how pauses within movements are cut short."""
    names = "RADIUS GAP PAUSE REST LAST_REST SHORTEST WINDOWS FEWEST EQUAL WHOLE ROUNDS"
    return _numbers(pauses, *names.split())


def _numbers(module: ModuleType, *names: str) -> dict[str, float]:
    """Return constants of a module by their names in small letters; the runtime has none of them itself."""
    return {name.lower(): getattr(module, name) for name in names}


def rotation_rule(procrustes: Procrustes) -> dict[str, Any]:
    """How movements are rotated.

    Raises
    ------
    SpecificationError
        By at most an angle, in space.
    """
    d, prior = procrustes.n_dims, procrustes.prior
    if d == 3 and prior is None and procrustes.max_angle > 0:
        raise SpecificationError(
            "expected movements in space to be compared under a rotation prior, with max_angle=0 or with max_angle=pi, "
            f"got max_angle={procrustes.max_angle:.3g}: the page has no limit in between; {_AGAIN}"
        )
    matrix = None if prior is None else prior.matrix(d).ravel().tolist()
    return {"n_dims": d, "max_angle": float(procrustes.max_angle), "prior": matrix}


def pair_rule(shapes: Shapes) -> dict[str, Any]:
    """How segments and points are compared."""
    elastic, cloud = shapes.elastic, shapes.cloud
    return {
        "n_segments": elastic.n_segments,
        "band": elastic.band,
        "position_weight": elastic.position_weight,
        "turning_weight": elastic.turning_weight,
        "n_points": cloud.n_points,
        "cloud_turning_weight": cloud.turning_weight,
        "line_weight": cloud.line_weight,
    }


def _classifier(classifier: Classifier) -> dict[str, Any]:
    if isinstance(classifier, Prototype):
        return {"classifier": "prototype", "medoids": classifier.medoids.tolist()}
    for kind, name in ((NearestEach, "nearest-each"), (Nearest, "nearest")):
        if isinstance(classifier, kind):
            return {"classifier": name}
    raise SpecificationError(
        "expected the classifier to be one of auto, nearest-each, nearest and prototype, got svm, which the page does "
        f"not have; {_AGAIN}"
    )


def _calibration(calibration: Calibration) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Scores in rising order; classes that share the pooled ones name the same number."""
    shared = [(id(a), id(b)) for a, b in zip(calibration.pooled, calibration.pooled_novelties, strict=True)]
    numbers = {pair: k for k, pair in enumerate(dict.fromkeys(shared))}
    first = [shared.index(pair) for pair in numbers]
    parts = {
        "own scores": calibration.own,
        "own novelties": calibration.own_novelties,
        "pooled scores": [calibration.pooled[c] for c in first],
        "pooled novelties": [calibration.pooled_novelties[c] for c in first],
    }
    arrays: dict[str, NDArray[Any]] = {"scales": np.asarray(calibration.scales, dtype=np.float64)}
    for name, several in parts.items():
        arrays[name] = np.concatenate([np.sort(one) for one in several])
        arrays[f"{name} ends"] = np.cumsum([len(one) for one in several]).astype(np.int32)
    header = {
        "between": calibration.between,
        "exponent": calibration.exponent,
        "guesses": list(GUESSES),
        **_numbers(left_out, "LEAST", "ROUNDING", "DIMENSIONS", "MEAN_LENGTH", "REACH_OF_STRANGERS", "REACH_TO_NEXT"),
    }
    return {"pooled": [numbers[pair] for pair in shared], **header}, arrays


def early_part(known: KnownClasses, early: Early | None = None) -> dict[str, Any]:
    """Header of early recognition: spreads, rotations, widths, and how fast movements are at their end."""
    made = hypotheses(known.comparison, known.references, early or Early())
    spreads = {name: getattr(made.early, name) for name in ("size_spread", "duration_spread", "timing_spread")}
    assert made.described.pairs is not None
    return {
        "n_progress": made.early.n_progress,
        **{name: None if math.isinf(value) else value for name, value in spreads.items()},
        "own_rotations": made.early.max_angle is not None,
        "rule": rotation_rule(made.procrustes),
        "shapes": pair_rule(made.described.pairs.shapes),
        "widths": made.widths.tolist(),
        "over": list(made.ending.over),
        "before": list(made.ending.before),
        "numbers": {
            **_numbers(evidence, "COMPARED", "WIDENED", "ROTATION", "SPEED_SPREAD", "PROGRESS", "POWER", "NEGLIGIBLE"),
            **_numbers(beginnings, "MOST_ODDS", "PRIOR_ODDS", "LOG_UNKNOWN", "TEMPER", "EXPLAINING"),
            **_numbers(prefixes, "LAST", "LEAST_SPEED"),
        },
    }
