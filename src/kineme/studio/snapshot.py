"""A library, or a fitted recognizer, as plain data and arrays that a browser computes with."""

from __future__ import annotations

import json
import math
from base64 import b64encode
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.discrete.operators import decoder, smoothness_factor, trajectory_regression
from kineme.dmp.pose.pose_dmp import PosePrimitives
from kineme.errors import SpecificationError, warn
from kineme.kernels.pair_distances import Shapes
from kineme.kernels.procrustes import Procrustes
from kineme.library.grounding import prototype_of
from kineme.library.library import ActionLibrary
from kineme.library.members import Members, members_of, some_of_each
from kineme.library.recognize import known_members
from kineme.library.storage import read
from kineme.library.storage.symbols import symbol
from kineme.movements.channels.channel import Channels
from kineme.movements.channels.coordinates import period_by_unit
from kineme.movements.channels.detect import unit_of
from kineme.movements.preparation import glitches, pauses
from kineme.movements.preparation.smooth import spline_matrix
from kineme.recognition import conformal
from kineme.recognition.answer import LEAST_CONFIDENCE, FittedRecognizer, KnownClasses, known_classes
from kineme.recognition.classifiers import (
    LogarithmicPool,
    Nearest,
    NearestEach,
    NearestProfiled,
    Prototype,
    SupportVectors,
    fit_prototype,
)
from kineme.recognition.conformal import GUESSES, RULES, Calibration
from kineme.recognition.early import evidence
from kineme.recognition.early import hypotheses as beginnings
from kineme.recognition.early.hypotheses import Early, hypotheses
from kineme.similarity.comparison import Comparison
from kineme.similarity.describe import N_POINTS, Pairs, even_paths, feature_rows
from kineme.similarity.scores import Classifier
from kineme.similarity.specification import DETAILED_POSITIONS, Representation, forcing_operator, rotating

#: Numbers of the stored paths, those of early recognition included, at most: 1.3 MB in base64, so that a page with all
#: else stays below 2 MB.
MOST_NUMBERS = 240_000

_BOUNDARY = ("starts", "goals", "velocities", "durations", "extents")

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

_Arrays = dict[str, NDArray[Any]]

FORMAT, VERSION = "kineme-snapshot", 6
_KINDS = ("float64", "float32", "int32")
_ROUNDING = 1e-6  # of a path's size: some units in the last place of single precision
_ALIGNMENT = 8  # bytes: arrays in JavaScript begin at multiples of the size of their numbers


@dataclass(frozen=True, eq=False)
class Snapshot:
    """JSON data (names, specification, widths, weights) and arrays of float64, float32 or int32 for the runtime."""

    header: dict[str, Any]
    arrays: dict[str, NDArray[Any]]

    def to_json(self) -> str:
        """One JSON document: the header, where each array is, and all of them as one block of bytes in base64.

        No ``<`` is left in it, so that it can stand in a script element of a page.
        """
        places, block = {}, bytearray()
        for name, array in self.arrays.items():
            if array.dtype.name not in _KINDS:
                raise ValueError(f"expected arrays of {', '.join(_KINDS)}, got {name} of {array.dtype}")
            places[name] = [array.dtype.name, len(block), array.size]
            block += np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<")).tobytes()
            block += bytes(-len(block) % _ALIGNMENT)
        document = {"format": FORMAT, "version": VERSION, **self.header, "arrays": places}
        document["data"] = b64encode(block).decode()
        return json.dumps(document, allow_nan=False, separators=(",", ":")).replace("<", r"\u003c")


def recognition_parts(classes: KnownClasses) -> Snapshot:
    """Header and arrays of what recognizes movements."""
    demos = classes.references.all_movements()
    paths = even_paths(demos, 0, len(demos), classes.comparison.cutoff)
    arrays: _Arrays = {
        "paths": paths.astype(np.float32),
        "starts": np.asarray(demos.positions[demos.offsets[:-1]], dtype=np.float64),
    }
    header = {
        "n_movements": len(classes.references),
        "columns": _columns(demos.channels),
        "classes": [str(name) for name in classes.references.classes.tolist()],
        "first": classes.references.first.tolist(),
        "comparison": _comparison(classes.comparison, classes.references.described.pairs, arrays),
        "calibration": _calibration(classes.calibration, arrays),
        "certainty": dict(LEAST_CONFIDENCE),
        **_classifier(classes.classifier),
    }
    if header["comparison"]["details"] is not None:
        arrays["detailed rows"] = feature_rows(demos, classes.comparison.specification)[-1].astype(np.float32)
    return Snapshot(header, arrays)


def _columns(channels: Channels | None) -> list[dict[str, Any]] | None:
    """Write the heads of the coordinates, with their units, and what angles wrap by; None where they have no names."""
    if channels is None:
        return None
    return [
        {
            "head": f"{name} [{channel.unit}]" if channel.unit and unit_of(name) is None else name,
            "period": (period_by_unit(channel.unit) or channel.period or None) if channel.kind == "angle" else None,
        }
        for channel in channels
        for name in channel.coordinates
    ]


def _comparison(how: Comparison, pairs: Pairs | None, arrays: _Arrays) -> dict[str, Any]:
    """Write how movements are compared; the matrices that this needs are added to the arrays."""
    representations, similarity = how.representations, how.similarity
    by_rows = [representation for representation in representations if not representation.in_pairs]
    n = len(representations)
    weights = np.full(n, 1.0 / n) if similarity.weights is None else similarity.weights
    return {
        "n_dims": how.n_dims,
        "cutoff": how.cutoff,
        "translation": how.normalization.translation,
        "scale": how.normalization.scale,
        "pauses": pause_rule(),
        "mean": how.mean,
        "rule": rotation_rule(how.procrustes),
        "by_rows": [
            _row_representation(representation, how.n_dims, r, arrays) for r, representation in enumerate(by_rows)
        ],
        "by_pairs": [representation.measure for representation in representations[len(by_rows) :]],
        "rotating": rotating(representations) if pairs is not None else -1,
        "shapes": None if pairs is None else pair_rule(pairs.shapes),
        "details": None if pairs is None or pairs.details is None else _detail_rule(how, pairs.details),
        "widths": [float(width) if np.isfinite(width) else None for width in similarity.widths],
        "weights": weights.tolist(),
        "names": [representation.name for representation in representations],
    }


def _row_representation(representation: Representation, n_dims: int, r: int, arrays: _Arrays) -> dict[str, Any]:
    """Write what is compared sample by sample in n dimensions: its parameters, and matrices that describing needs."""
    row = _fields(representation, "quantity", "arc_share", "n_points", "signal")
    if representation.quantity == "forcing":
        row["operator"] = f"operator {r}"
        arrays[row["operator"]] = forcing_operator(representation, np.dtype(np.float32))
    over_time = representation.arc_share == 0 or (n_dims == 1 and representation.signal)
    if over_time and (N_POINTS - 1) % (representation.n_points - 1):
        row["resample"] = f"resample {r}"
        arrays[row["resample"]] = spline_matrix(N_POINTS, representation.n_points)
    return row


def pause_rule(allowance: float = 1.0) -> dict[str, Any]:
    """Return how glitches are taken out, and pauses cut short, which count `allowance` times as long."""
    shares = _numbers(pauses, "PAUSE", "REST", "LAST_REST")
    return {
        **{name: allowance * share for name, share in shares.items()},
        **_numbers(pauses, "RADIUS", "GAP", "SHORTEST", "WINDOWS", "FEWEST", "EQUAL", "SAME_COUNT", "ROUNDS"),
        "glitches": _numbers(glitches, "LENGTH", "STEPS", "RETURN", "MEAN_STEPS"),
    }


def _detail_rule(how: Comparison, details: Shapes) -> dict[str, Any]:
    """Write how movements are compared in detail."""
    own = _fields(how.specification, "upright") | {"cutoff": how.specification.detailed_cutoff}
    if how.specification.are_signals(how.n_dims):
        own["pauses"] = pause_rule() | {"radius": -1.0}  # nothing is so near to itself: rests stay
    positions = _fields(how.specification.detailed_positions, "arc_share", "n_points", "signal")
    return pair_rule(details) | own | {"positions": positions}


def _fields(record: Any, *names: str) -> dict[str, Any]:
    return {name: getattr(record, name) for name in names}


def _numbers(module: ModuleType, *names: str) -> dict[str, float]:
    """Return constants of a module by their names in small letters; the runtime has none of them itself."""
    return {name.lower(): getattr(module, name) for name in names}


def rotation_rule(procrustes: Procrustes) -> dict[str, Any]:
    """Write how movements are rotated."""
    d, prior = procrustes.n_dims, procrustes.prior
    if d == 3 and prior is None and procrustes.max_angle > 0:
        raise SpecificationError(
            "expected movements in space to be compared under a rotation prior, with max_angle=0 or with max_angle=pi, "
            f"got max_angle={procrustes.max_angle:.3g}: the page has no limit in between; {_AGAIN}"
        )
    matrix = None if prior is None else prior.matrix(d).ravel().tolist()
    how = _fields(procrustes, "n_dims", "n_points", "mixing")
    return how | {"max_angle": float(procrustes.max_angle), "prior": matrix}


def pair_rule(shapes: Shapes) -> dict[str, Any]:
    """Write how segments and points are compared."""
    elastic, cloud = shapes.elastic, shapes.cloud
    return {
        **_fields(elastic, "n_segments", "band", "position_weight", "turning_weight"),
        **_fields(cloud, "n_points", "line_weight"),
        "cloud_turning_weight": cloud.turning_weight,
    }


def _classifier(classifier: Classifier) -> dict[str, Any]:
    if isinstance(classifier, Prototype):
        return {"classifier": "prototype", "medoids": classifier.medoids.tolist()}
    for kind, name in ((NearestEach, "nearest-each"), (Nearest, "nearest")):
        if isinstance(classifier, kind):
            return {"classifier": name}
    raise SpecificationError(
        "expected the classifier to be nearest-each, nearest or prototype, got "
        f"{'svm' if isinstance(classifier, SupportVectors) else 'convolutions'}, which the page does not have; "
        "pass classifier='nearest-each'"
    )


def _calibration(calibration: Calibration, arrays: _Arrays) -> dict[str, Any]:
    """Add scores to the arrays in rising order; classes that share the pooled ones name the same number."""
    shared = [(id(a), id(b)) for a, b in zip(calibration.pooled, calibration.pooled_novelties, strict=True)]
    numbers = {pair: k for k, pair in enumerate(dict.fromkeys(shared))}
    first = [shared.index(pair) for pair in numbers]
    parts = {
        "own scores": calibration.own,
        "own novelties": calibration.own_novelties,
        "pooled scores": [calibration.pooled[c] for c in first],
        "pooled novelties": [calibration.pooled_novelties[c] for c in first],
    }
    arrays["scales"] = np.asarray(calibration.scales, dtype=np.float64)
    for name, several in parts.items():
        arrays[name] = np.concatenate([np.sort(scores) for scores in several])
        arrays[f"{name} ends"] = np.cumsum([len(scores) for scores in several]).astype(np.int32)
    return {
        "pooled": [numbers[pair] for pair in shared],
        **_fields(calibration, "between", "exponent"),
        "guesses": list(GUESSES),
        "promises": dict(RULES),
        **_numbers(conformal, "LEAST", "ROUNDING", "DIMENSIONS", "MEAN_LENGTH", "REACH_OF_STRANGERS", "REACH_TO_NEXT"),
    }


def early_parts(classes: KnownClasses, early: Early | None = None) -> Snapshot:
    """Header and arrays of early recognition, with the movements that have another path where pauses count more."""
    described = hypotheses(classes.comparison, classes.references, early or Early())
    spreads = _fields(described.early, "size_spread", "duration_spread", "timing_spread")
    assert described.described.pairs is not None
    header = {
        "n_progress": described.early.n_progress,
        **{name: None if math.isinf(value) else value for name, value in spreads.items()},
        "own_rotations": described.early.max_angle is not None,
        "signals": described.are_signals,
        "pauses": pause_rule(beginnings.ALLOWANCE),
        "rule": rotation_rule(described.procrustes),
        "shapes": pair_rule(described.described.pairs.shapes),
        "widths": described.widths.tolist(),
        "over": list(described.ending.over),
        "before": list(described.ending.before),
        "numbers": {
            **_numbers(evidence, "COMPARED", "WIDENED", "ROTATION", "SPEED_SPREAD", "PROGRESS", "POWER", "NEGLIGIBLE"),
            **_numbers(beginnings, "MOST_ODDS", "PRIOR_ODDS", "LOG_UNKNOWN", "TEMPER", "EXPLAINING"),
            **_numbers(beginnings, "LAST", "LEAST_SPEED"),
        },
    }
    demos = classes.references.all_movements()
    wholes = even_paths(demos, 0, len(demos), classes.comparison.cutoff)
    apart = np.abs(described.paths - (wholes - wholes[:, :, :1])).max(axis=(1, 2))
    own = np.flatnonzero(apart > _ROUNDING * np.abs(wholes).max(axis=(1, 2)))
    arrays: dict[str, NDArray[Any]] = {
        "early movements": own.astype(np.int32),
        "early paths": described.paths[own].astype(np.float32),
        "durations": described.durations,
    }
    return Snapshot(header, arrays)


def movement_parts(primitives: Primitives, *, learns: bool = True) -> Snapshot:
    """Header and arrays of C primitives, one of each class, and with `learns` of what fits other movements.

    Weights are in single precision, as libraries store them. The matrix that fits the path has no goal in it, so that
    the runtime can fit any formulation: ``W = E (y - goal (g - x0))``, of which only `goal` differs.
    """
    dmp = primitives.dmp
    header = {
        **_fields(dmp, "formulation", "n_basis", "n_points", "K", "D", "overlap", "gating"),
        "n_dims": primitives.n_dims,
        "alpha": dmp.basis.phase.alpha,
        "encodes": learns and dmp.fit == "trajectory" and not dmp.preprocessing,
    }
    arrays: dict[str, NDArray[Any]] = {
        "weights": primitives.scaled_weights.astype(np.float32),
        **{f"primitive {name}": np.asarray(getattr(primitives, name), dtype=np.float64) for name in _BOUNDARY},
        "smooth": smoothness_factor(dmp),
    }
    if header["encodes"]:
        response = decoder(dmp, dmp.n_points)
        response = response._replace(goal=np.zeros_like(response.goal))
        weights, velocity = trajectory_regression(response, dmp.K, dmp.ridge_strength)
        arrays |= {"encoder": weights, "encoder velocity": velocity}
    return Snapshot({"movements": header}, arrays)


def snapshot_of_primitive(primitive: Primitives | PosePrimitives) -> Snapshot | None:
    """A batch of one, for `openPrimitive` of the runtime; None unless every column is a position, all that it knows."""
    if isinstance(primitive, PosePrimitives) or any(channel.kind != "position" for channel in primitive.channels or ()):
        return None
    return movement_parts(primitive, learns=False)


def snapshot_of_library(library: ActionLibrary, most: int | None = None, early: Early | None = None) -> Snapshot:
    """The symbols of a library with `most` of their movements, equally many of each, as if it held these alone.

    By default as many as fit into 2 MB, 451 in the plane and 300 in space, or half of that if all of them pause;
    ``header["n_all"]`` says of how many. `early` is how movements are recognized under way.
    """
    store = library.store
    members = members_of(store)
    how = store.specification.comparison
    numbers = N_POINTS + DETAILED_POSITIONS.n_points * (len(how.stored_rows) - len(how.by_rows))
    fitting = MOST_NUMBERS // (numbers * (store.n_dims or 1))
    taken = some_members(members, fitting if most is None else most)
    prototypes = [prototype_of(store, symbol(store, str(name))) for name in members.names]
    primitives = read.primitives(store, np.array(prototypes, dtype=np.int64))
    snapshot = _snapshot(known_members(store, taken), primitives, early)
    paths = ("paths", "early paths", "detailed rows")
    stored = sum(array.size for name, array in snapshot.arrays.items() if name in paths)
    if most is None and stored > MOST_NUMBERS:
        return snapshot_of_library(library, max(fitting * MOST_NUMBERS // stored, len(members.names)), early)
    snapshot.header["n_all"] = len(members.ids)
    snapshot.header["ids"] = taken.ids.tolist()
    snapshot.header["channels"] = None if store.channels is None else [channel.name for channel in store.channels]
    return snapshot


def snapshot_of_recognizer(
    recognizer: FittedRecognizer, dmp: DMP | None = None, early: Early | None = None
) -> Snapshot:
    """A fitted recognizer, with a primitive of the medoid of each class; `early` as in `snapshot_of_library`.

    Warns where the recognizer adds random convolutions by itself: the page has the kernels alone.
    """
    classes = known_classes(recognizer)
    if isinstance(classes.classifier, LogarithmicPool | NearestProfiled):
        warn(
            "the page answers by the kernels alone, without the random convolutions that this recognizer adds: some "
            "answers may differ; make it with classifier='nearest-each' for the same ones",
            UserWarning,
            2,
        )
        classes = replace(classes, classifier=NearestEach(), calibration=recognizer.calibration_of_kernels())
    demos = classes.references.all_movements()
    medoids = fit_prototype(classes.comparison, classes.references).medoids
    return _snapshot(classes, (dmp or DMP()).learn(demos[medoids]), early)


def some_members(members: Members, most: int) -> Members:
    """At most `most` members in all: of each symbol the same number, evenly spaced, or all that it has."""
    counts = np.diff(members.first, append=len(members.ids))
    if most < len(counts):
        raise SpecificationError(
            f"expected at most {most} symbols, as many as there may be movements, got {len(counts)}; take more of "
            "these, in the shell with --most, or make a library of some of the symbols"
        )
    each = int(counts.max(initial=1))
    while np.minimum(counts, each).sum() > most:
        each -= 1
    return some_of_each(members, each)


def _snapshot(classes: KnownClasses, primitives: Primitives, early: Early | None = None) -> Snapshot:
    recognition, movements, begun = recognition_parts(classes), movement_parts(primitives), early_parts(classes, early)
    header: dict[str, Any] = {**recognition.header, **movements.header, "early": begun.header}
    return Snapshot(header, recognition.arrays | movements.arrays | begun.arrays)
