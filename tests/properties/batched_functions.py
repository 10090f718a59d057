"""Every public function that takes many movements at once, in one table; a new one that is missing fails a test.

Each row says how to call the function and how closely a movement must come out the same in any company and order,
compiled and plain. Results are in units of the movement itself, so that a small one has no tolerance to hide in next
to a large one: positions by its extent, velocities by extent per duration, and so on.
"""

from __future__ import annotations

import atexit
import shutil
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from drawn_movements import poses, reaches, rhythms, rows
from scipy.spatial.transform import Rotation

from kineme import (
    DMP,
    ActionLibrary,
    Demonstrations,
    DMPFeatures,
    Recognizer,
    Resample,
    RhythmicDMP,
    RhythmicFeatures,
    Smooth,
    TrimRest,
    couple,
    preprocess,
    styles,
)
from kineme.dmp import Primitives
from kineme.dmp.discrete.specification import FORMULATIONS, GATINGS
from kineme.dmp.join import laid_out, laid_out_poses
from kineme.dmp.spring_damper import FITS
from kineme.errors import ExtrapolationWarning
from kineme.features.movement_features import FEATURES, PoseFeatures
from kineme.kernels import KERNELS, MEANS, averaged
from kineme.kernels.pair_distances import listed_distances, pair_bounds, pair_distances, shapes_of
from kineme.kernels.procrustes import Procrustes
from kineme.kernels.random_binning import RandomBinning
from kineme.movements.channels.channel import Channel
from kineme.movements.preparation.resample import resample_by_arc_length
from kineme.movements.rotations import matrices_of, rotated
from kineme.movements.trajectories.as_learned import as_learned
from kineme.movements.trajectories.movements import of_channels
from kineme.orientation import PoseDMP, continuous, from_tangent, normalized, to_tangent
from kineme.recognition.answer import Answer
from kineme.recognition.early.evidence import cut
from kineme.similarity.bounds import fit_bases, reduce_features
from kineme.similarity.describe import describe_rows, feature_rows, maps_onto, paths_of, recorded_values
from kineme.similarity.describe import moved as laid_onto
from kineme.similarity.similarity import compare
from kineme.similarity.specification import ROW_REPRESENTATIONS, SCALES, ComparisonSpecification, Normalization
from kineme.validation import Array


@dataclass(frozen=True)
class Batched:
    """A function of a batch.

    `call` gives one result per member, a dictionary of arrays in units of the member. Two results are the same where
    they differ by at most `tolerance`, in units of the larger of 1 and the largest number of the array.
    """

    name: str
    call: Callable[[Any], list[dict[str, Any]]]
    tolerance: float
    draw: Callable[[Any], Any] = reaches
    alone: int = 8  # members that are computed alone too


def each(n: int, **columns: Any) -> list[dict[str, Any]]:
    """One dictionary per member from arrays (n, ...)."""
    assert all(len(column) == n for column in columns.values()), {k: len(v) for k, v in columns.items()}
    return [{name: np.asarray(column[i]) for name, column in columns.items()} for i in range(n)]


def extents(demos: Demonstrations) -> Any:
    """Of each movement, its widest dimension, shape (n,)."""
    first = demos.offsets[:-1]
    return (np.maximum.reduceat(demos.positions, first) - np.minimum.reduceat(demos.positions, first)).max(axis=1)


def by_extent(demos: Demonstrations, array: Any) -> Any:
    """Array (n, ...) in units of the extents."""
    return array / extents(demos).reshape(-1, *[1] * (array.ndim - 1))


def movements(before: Demonstrations, after: Demonstrations) -> list[dict[str, Any]]:
    """Positions from the recorded start, in units of the extent, and stamps from the start, of the duration."""
    unit, start = extents(before), before.positions[before.offsets[:-1]]
    return [
        {
            "positions": (one.positions - start[i]) / unit[i],
            "times": (one.times - one.times[0]) / before.durations[i],
            "duration": one.duration / before.durations[i],
            "label": np.array(one.label == before[i].label),
        }
        for i, one in enumerate(after)
    ]


def learned(demos: Demonstrations, primitives: Any) -> list[dict[str, Any]]:
    """The numbers of discrete primitives."""
    start = demos.positions[demos.offsets[:-1]]
    return each(
        len(primitives),
        weights=by_extent(demos, primitives.scaled_weights) / primitives.dmp.K,
        starts=by_extent(demos, primitives.starts - start),
        goals=by_extent(demos, primitives.goals - start),
        velocities=by_extent(demos, primitives.velocities) * demos.durations[:, None],
        extents=by_extent(demos, primitives.extents),
        durations=primitives.durations / demos.durations,
    )


def moved(demos: Demonstrations, rollout: Any) -> list[dict[str, Any]]:
    """A generated movement and its derivatives."""
    start, tau = demos.positions[demos.offsets[:-1]], demos.durations[:, None, None]
    return each(
        len(rollout),
        positions=by_extent(demos, rollout.positions - start[:, None]),
        velocities=by_extent(demos, rollout.velocities) * tau,
        accelerations=by_extent(demos, rollout.accelerations) * tau**2,
        times=rollout.times / demos.durations[:, None],
        stamps=[one.times / demos[i].duration for i, one in enumerate(rollout.trajectories)],
    )


def learn_row(dmp: DMP) -> Batched:
    name = f"DMP.learn {dmp.formulation} {dmp.fit if dmp.fit == 'trajectory' else dmp.regression} {dmp.gating}"
    return Batched(name, lambda demos: learned(demos, dmp.learn(demos)), 1e-8)


def feature_row(formulation: str, feature: str, fit: str, dtype: str = "float64") -> Batched:
    """Features that scale with the movement are measured in its extent."""
    scales = not (formulation == "original" and feature != "shape-attractor")

    def call(demos: Demonstrations) -> list[dict[str, Any]]:
        rows = DMPFeatures(feature, DMP(formulation, 20, fit=fit, n_points=50), dtype=dtype).fit(demos).transform(demos)
        assert rows.dtype == dtype
        return each(len(demos), rows=by_extent(demos, rows) / 100 if scales else rows)

    return Batched(f"DMPFeatures {formulation} {feature} {fit} {dtype}", call, 1e-8 if dtype == "float64" else 3e-7)


def step_row(step: Any, tolerance: float) -> Batched:
    return Batched(f"preprocess {step}", lambda demos: movements(demos, preprocess(demos, [step])), tolerance)


def rollout_of(demos: Demonstrations) -> list[dict[str, Any]]:
    """With other starts, goals, durations and velocities; each by the movement itself."""
    primitives = DMP("amplitude-scaled", n_basis=20).learn(demos)
    ends, tau = primitives.goals - primitives.starts, primitives.durations
    options = {"start": primitives.starts + 0.1 * ends, "goal": primitives.goals + 0.3 * ends, "duration": 2 * tau}
    return moved(demos, primitives.rollout(**options, velocity=0.5 * ends / tau[:, None]))


def to_moving_goals(demos: Demonstrations) -> list[dict[str, Any]]:
    """To goals that move, each by its own velocity, through a point."""
    primitives = DMP("bio-inspired", n_basis=20).learn(demos)
    ends, tau = primitives.goals - primitives.starts, primitives.durations
    points, velocities = primitives.starts + 0.4 * ends, 0.3 * (ends[:, ::-1] / tau[:, None])
    return moved(demos, primitives.rollout(via=[(0.4, points)], goal_velocity=velocities))


def coupled(demos: Demonstrations) -> list[dict[str, Any]]:
    """Each with a movement to another goal, which is as large."""
    left = DMP("decoupled", n_basis=20).learn(demos)
    ends = left.goals - left.starts
    right = left.rollout(goal=left.goals + 0.2 * ends)
    one, other = couple(left, right, during=(0.3, 0.6), offset=0.3 * ends)
    rows = zip(moved(demos, one.rollout()), moved(demos, other.rollout()), strict=True)
    return [a | {f"other {name}": value for name, value in b.items()} for a, b in rows]


def modulated(demos: Demonstrations) -> list[dict[str, Any]]:
    """Through a point of its own, with one dimension free, and on at the goal; as primitives of their own."""
    primitives = DMP("decoupled", n_basis=20).learn(demos)
    ends, tau = primitives.goals - primitives.starts, primitives.durations
    points = primitives.starts + 0.4 * ends
    points[ends[:, 0] > 0, 1] = np.nan
    path = primitives.rollout(via=[(0.4, points)], end_velocity=0.2 * ends / tau[:, None])
    own = Primitives.from_rollout(path).rollout()
    least = own.least_duration(velocity=1.0) / extents(demos)
    return [one | {"least": np.array(least[i])} for i, one in enumerate(moved(demos, own))]


def along_stretches(demos: Demonstrations) -> list[dict[str, Any]]:
    """Along a stretch that bends more than the basis functions can, each its own."""
    primitives = DMP("bio-inspired", n_basis=20).learn(demos)
    ends, u = primitives.goals - primitives.starts, np.linspace(0.4, 0.6, 12)
    zigzag = 0.05 * (-1.0) ** np.arange(12)
    points = primitives.starts[:, None] + (u + zigzag)[:, None] * ends[:, None]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExtrapolationWarning)
        return moved(demos, primitives.rollout(via=[((0.4, 0.6), points)]))


def saved(demos: Demonstrations) -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        path = DMP(n_basis=20).learn(demos).save(f"{folder}/primitives.npz")
        return learned(demos, Primitives.load(path))


def concatenated(demos: Demonstrations) -> list[dict[str, Any]]:
    primitives = DMP(n_basis=20).learn(demos)
    return moved(demos, type(primitives).concatenate([primitives[i] for i in range(len(primitives))]).rollout())


def arc(demos: Demonstrations) -> list[dict[str, Any]]:
    paths = preprocess(demos, [Resample(60)]).positions.reshape(len(demos), 60, -1).transpose(0, 2, 1)
    paths = paths - paths[:, :, :1]
    both = [resample_by_arc_length(paths, 40, share) for share in (1.0, 0.4)]
    return each(len(demos), whole=by_extent(demos, both[0]), part=by_extent(demos, both[1]))


@cache
def recognizer(n_columns: int = 2) -> Recognizer:
    """From three demonstrations of each of five kinds, whatever is drawn later."""
    drawn = [(40 + 3 * i, 0, "jitter", 0, 100 + i // 3) for i in range(15)]
    noise = np.random.default_rng(7)
    shown = reaches(drawn)
    arrays = [one.positions + 0.03 * noise.normal(size=one.positions.shape).cumsum(axis=0) / 6 for one in shown]
    return Recognizer().fit([in_columns(array, n_columns) for array in arrays], [f"{i // 3}" for i in range(15)])


def in_columns(positions: Array, n: int) -> Array:
    """So many columns of the plane: its own, their sum and their difference."""
    x, y = positions.T
    return np.column_stack([x, y, x + y, x - y])[:, :n]


def recognized_columns(n: int) -> Batched:
    def numbers(demos: Demonstrations) -> list[dict[str, Any]]:
        arrays = [in_columns(one.positions, n) for one in demos]
        return recognized(Demonstrations.from_arrays(arrays, times=[one.times for one in demos]), n)

    return Batched(f"Recognizer of {n} columns", numbers, 2e-5)


def recognized(demos: Demonstrations, n_columns: int = 2) -> list[dict[str, Any]]:
    known = recognizer(n_columns)
    return each(
        len(demos),
        similarity=np.sqrt(-2 * known.log_similarity(demos)),
        decision=np.sqrt(-2 * known.decision_function(demos)),
        shares=known.predict_proba(demos),
        p_values=known.p_values(demos, 0.2),
        novelty=known.novelty(demos),
        label=known.predict(demos).astype(int),
        known=[-1 if label is None else int(label) for label in known.predict_known(demos)],
    )


def answers(demos: Demonstrations) -> list[dict[str, Any]]:
    return as_numbers(demos, recognizer().recognize(demos))


@cache
def library() -> ActionLibrary:
    """What the recognizer knows, learned."""
    folder = Path(tempfile.mkdtemp(prefix="kineme-properties-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    made = ActionLibrary(folder, create=True)
    known = recognizer()
    made.learn(known.demonstrations_, labels=known.references_.labels.tolist())
    return made


def library_answers(demos: Demonstrations) -> list[dict[str, Any]]:
    return as_numbers(demos, library().recognize(demos))


def as_numbers(demos: Demonstrations, given: list[Answer]) -> list[dict[str, Any]]:
    unit = extents(demos)
    return [
        {
            "label": np.array(-1 if one.label is None else int(one.label)),
            "confidence": np.array(one.confidence),
            "p_known": np.array(one.p_known),
            "p_values": np.array(list(one.p_values.values())),
            "ranked": np.array(one.ranked).astype(int),
            "nearest": np.array([near.index for near in one.nearest]),
            "similarity": np.array([near.similarity for near in one.nearest]),
            "matrix": one.transform.matrix / unit[i],
            "shift": (one.transform.shift - demos[i].positions[0]) / unit[i],
            "responsibilities": np.array(list(one.responsibilities.values())),
        }
        for i, one in enumerate(given)
    ]


def partly_seen(demos: Demonstrations) -> list[dict[str, Any]]:
    return each(len(demos), label=recognizer().predict_partial(demos).astype(int))


def described(scale: str, translation: bool, cutoff: float | None) -> Batched:
    def call(demos: Demonstrations) -> list[dict[str, Any]]:
        if scale == "none":
            unit = np.repeat(extents(demos), demos.lengths)[:, None]
            demos = Demonstrations.from_arrays(
                np.split(demos.positions / unit, demos.offsets[1:-1]),
                times=np.split(demos.times, demos.offsets[1:-1]),
            )
        specification = ComparisonSpecification(ROW_REPRESENTATIONS, Normalization(translation, scale), cutoff)
        rows = feature_rows(demos, specification)
        return each(len(demos), **{one.name: row for one, row in zip(ROW_REPRESENTATIONS, rows, strict=True)})

    return Batched(f"feature_rows {scale} {translation} {cutoff}", call, 1e-8)


def compared(demos: Demonstrations) -> list[dict[str, Any]]:
    """Described in several ways, and compared with what the recognizer stores."""
    comparison, references = recognizer().comparison_, recognizer().references_
    blocks = feature_rows(demos, comparison.specification)
    stored = describe_rows(np.concatenate(blocks, axis=1), demos.n_dims, comparison)
    by_rows = blocks[: len(comparison.specification.by_rows)]
    reduced = reduce_features(fit_bases((np.eye(200),) * len(by_rows), stored.n_dims), by_rows, stored.n_dims)
    return each(
        len(demos),
        stored=compare(comparison.similarity, stored, references.described),
        given=compare(comparison.similarity, comparison.prepared(blocks), references.described),
        reduced=np.concatenate([one.values for one in reduced], axis=1),
    )


def aligned(demos: Demonstrations) -> list[dict[str, Any]]:
    """Laid onto one movement, as paths and as primitives."""
    paths, onto = paths_of(demos), paths_of(recognizer().demonstrations_[:1])[0]
    maps = maps_onto(paths, onto)
    laid = laid_onto(DMP(n_basis=20, fit="trajectory").learn(demos), maps)
    return each(
        len(demos),
        matrices=maps.matrices * extents(demos)[:, None, None],
        paths=maps.move(paths),
        weights=laid.scaled_weights / laid.dmp.K,
        goals=laid.goals,
    )


def gram_row(name: str, kernel: Any, dtype: str) -> Batched:
    reference = np.random.default_rng(0).normal(size=(50, 12)).astype(dtype)

    def call(X: Any) -> list[dict[str, Any]]:
        X = X.astype(dtype)
        return each(len(X), among_others=kernel(X, reference), as_reference=kernel(reference, X).T)

    return Batched(f"Gram {name} {dtype}", call, 1e-11 if dtype == "float64" else 2e-5, draw=rows)


def kernels() -> list[tuple[str, Any]]:
    """Every kernel of the table, each also averaged over dimensions by every mean that takes it."""
    made = []
    for name, row in KERNELS.items():
        kernel = row.kernel(**dict.fromkeys(row.widths, 1.0))
        made.append((name, kernel))
        made += [(f"{name} {mean}", averaged(kernel, 3, mean)) for mean in MEANS]
    return made


def procrustes_row(n_dims: int, max_angle: float, dtype: str) -> Batched:
    """Distances in units of the row; the reference is of the size of the row."""
    reference = np.random.default_rng(1).normal(size=(40, 12))
    compare = Procrustes(n_dims, max_angle)

    def call(X: Any) -> list[dict[str, Any]]:
        X = X / np.abs(X).max(axis=1, keepdims=True)
        A, B = compare.prepare(X.astype(dtype)), compare.prepare(reference.astype(dtype))
        turned = compare.rotations(X, reference[:1]) if len(X) == 1 else compare.rotations(X, reference[[0] * len(X)])
        back = compare.squared_distances(B, A).T
        return each(len(X), squares=compare.squared_distances(A, B), back=back, turned=turned)

    tolerance = 1e-10 if dtype == "float64" else 1e-5
    return Batched(f"Procrustes {n_dims} {max_angle:.2f} {dtype}", call, tolerance, draw=rows)


def pairs_row(n_dims: int) -> Batched:
    """Paths compared with others, each after the rotation that the other has."""

    def sized(X: Any) -> Any:
        x = (X / np.abs(X).max(axis=1, keepdims=True)).reshape(len(X), n_dims, -1)
        x = x - x.mean(axis=2, keepdims=True)
        return x / np.sqrt((x * x).sum(axis=1).mean(axis=1))[:, None, None]

    reference = shapes_of(sized(np.random.default_rng(3).normal(size=(40, 12))))
    turns = Rotation.random(40, random_state=0).as_matrix() if n_dims == 3 else np.ones((40, 2)) * 0.5**0.5

    def call(X: Any) -> list[dict[str, Any]]:
        shapes = shapes_of(sized(X))
        room = shapes.empty(len(X))
        for name, array in shapes.take(slice(None)).arrays().items():
            room.arrays()[name][:] = array
        R = np.broadcast_to(turns, (len(X), *turns.shape))
        few = pair_distances(shapes, reference.take(slice(2, 5)), R[:, 2:5])
        every, first = np.arange(len(X)), np.zeros(len(X), np.intp)
        return each(
            len(X),
            squares=pair_distances(room, reference, R).transpose(1, 0, 2),
            few=few.transpose(1, 0, 2),
            bounds=pair_bounds(shapes, reference, R).transpose(1, 0, 2),
            listed=listed_distances(shapes, reference, every, first, R[:, 0]).T,
        )

    return Batched(f"pair_distances {n_dims}", call, 2e-5, draw=rows)


def binned(X: Any) -> list[dict[str, Any]]:
    reference = 1e3 * np.random.default_rng(2).normal(size=(60, 12))
    return each(len(X), Z=RandomBinning(m=100.0, sigma=2.0).fit(reference).transform(X).toarray())


def rhythm_row(dmp: RhythmicDMP) -> Batched:
    def call(demos: Demonstrations) -> list[dict[str, Any]]:
        primitives = dmp.learn(demos)
        start = demos.positions[demos.offsets[:-1]]
        rollout = primitives.rollout(2.0, phase=primitives.phases, start=primitives.baselines)
        points = primitives.baselines + 0.5 * primitives.amplitudes[:, None]
        through = primitives.rollout(2.0, via=[(1.0, points)])
        return each(
            len(demos),
            scaled_weights=by_extent(demos, primitives.scaled_weights) / dmp.K,
            weights=primitives.weights / dmp.K,
            baselines=by_extent(demos, primitives.baselines - start),
            amplitudes=by_extent(demos, primitives.amplitudes),
            periods=primitives.periods / demos.durations,
            phases=np.exp(1j * primitives.phases).view(float).reshape(-1, 2),
            explained=primitives.explained,
            aligned_on=primitives.aligned_on,
            positions=by_extent(demos, rollout.positions - start[:, None]),
            velocities=by_extent(demos, rollout.velocities) * primitives.periods[:, None, None],
            accelerations=by_extent(demos, rollout.accelerations) * primitives.periods[:, None, None] ** 2,
            times=rollout.times / demos.durations[:, None],
            stamps=[one.times / demos[i].duration for i, one in enumerate(rollout.trajectories)],
            through=by_extent(demos, through.positions - start[:, None]),
            least=through.least_period(velocity=1.0) / extents(demos),
        )

    return Batched(f"RhythmicDMP.learn {dmp.fit}", call, 1e-6, draw=rhythms)


def rhythmic_features(demos: Demonstrations) -> list[dict[str, Any]]:
    shape, forcing = (
        RhythmicFeatures(feature, RhythmicDMP(align_on=0)).fit(demos).transform(demos)
        for feature in ("shape-attractor", "forcing")
    )
    return each(len(demos), shape=by_extent(demos, shape) / 100, forcing=forcing / 100)


def pose_extents(demos: Demonstrations) -> Any:
    """Of the positions alone."""
    return extents(Demonstrations.from_arrays([one.positions[:, :3] for one in demos]))


def pose_numbers(demos: Demonstrations) -> list[dict[str, Any]]:
    """Positions in extents of their own; orientations in radians."""
    unit, tau = pose_extents(demos)[:, None], demos.durations[:, None]
    units = np.column_stack((unit, unit, unit, np.ones((len(demos), 3))))
    primitives = PoseDMP(DMP(n_basis=20)).learn(demos)
    primitives = type(primitives).concatenate([primitives[i] for i in range(len(primitives))])
    assert primitives.labels.tolist() == demos.labels.tolist()
    assert primitives.names == demos.names
    asked = primitives.rollout(primitives.goals, primitives.starts, velocity=0.5 * units / tau)
    numbers = each(
        len(demos),
        weights=primitives.tangent.scaled_weights / (100 * units[:, :, None]),
        references=primitives.references,
        durations=primitives.durations / demos.durations,
    )
    points = primitives.rollout(n_samples=11).poses[:, 4]
    points[:, :3] += 0.05 * unit
    points[demos.durations > 1.0, 3:] = np.nan
    moving = 0.1 * units / tau
    through = type(primitives).from_rollout(primitives.rollout(via=[(0.4, points)], end_velocity=moving)).rollout()
    towards = primitives.rollout(via=[], goal_velocity=moving)
    least = {"least": through.least_duration(velocity=np.array([1e12] * 3 + [1.0] * 3))}
    parts = [posed(demos, movement) for movement in (primitives.rollout(), asked, through, towards)]
    named = [
        [{f"{what} {k}": v for k, v in one.items()} for one in part]
        for what, part in zip(("replayed", "asked", "through", "towards"), parts, strict=True)
    ]
    return [a | b | c | d | e | f for a, b, c, d, e, f in zip(numbers, *named, each(len(demos), **least), strict=True)]


def posed(demos: Demonstrations, rollout: Any) -> list[dict[str, Any]]:
    unit, tau = pose_extents(demos)[:, None, None], demos.durations[:, None, None]
    start = demos.positions[demos.offsets[:-1], None, :3]
    velocities, accelerations = rollout.velocities * tau, rollout.accelerations * tau**2
    return each(
        len(demos),
        path=(rollout.poses[:, :, :3] - start) / unit,
        orientations=rollout.orientations,
        velocities=np.concatenate((velocities[:, :, :3] / unit, rollout.angular_velocities * tau), axis=2),
        accelerations=np.concatenate((accelerations[:, :, :3] / unit, rollout.angular_accelerations * tau**2), axis=2),
        times=rollout.times / demos.durations[:, None],
        stamps=[one.times / demos[i].duration for i, one in enumerate(rollout.trajectories)],
    )


def parts_in_a_row(demos: Demonstrations) -> list[dict[str, Any]]:
    """Each after itself."""
    primitives = DMP(n_basis=20).learn(demos)
    start, tau = demos.positions[demos.offsets[:-1]], demos.durations[:, None]
    return each(
        len(demos),
        **{
            f"{name} {i}": value
            for i, part in enumerate(laid_out([primitives, primitives], shift=True))
            for name, value in (
                ("path", by_extent(demos, part.positions - start[:, None])),
                ("begin", by_extent(demos, part.begin_velocities) * tau),
                ("end", by_extent(demos, part.end_velocities) * tau),
            )
        },
    )


def poses_in_a_row(demos: Demonstrations) -> list[dict[str, Any]]:
    """Each alone: what comes after it may turn past a full turn. Orientations are apart from positions."""
    primitives = PoseDMP(DMP(n_basis=20)).learn(demos)
    laid, references = laid_out_poses([primitives], shift=False)
    start, unit = demos.positions[demos.offsets[:-1], None, :3], pose_extents(demos)[:, None, None]
    return each(
        len(demos),
        references=references * np.sign(references[:, :1]),
        **{f"path {i}": (part.positions[:, :, :3] - start) / unit for i, part in enumerate(laid)},
        **{f"vectors {i}": part.positions[:, :, 3:] for i, part in enumerate(laid)},
        turning=laid[0].begin_velocities[:, 3:] * demos.durations[:, None],
        turned=laid[0].end_velocities[:, 3:] * demos.durations[:, None],
    )


def recorded_numbers(demos: Demonstrations) -> list[dict[str, Any]]:
    """What a recording of the replayed poses would be, with a gripper that steps; positions in extents of their own."""
    elapsed = demos.times - np.repeat(demos.times[demos.offsets[:-1]], demos.lengths)
    gripper = elapsed > np.repeat(demos.durations / 3.0, demos.lengths)
    columns = np.column_stack((demos.positions[:, [0, 1, 2, 4, 5, 6, 3]], gripper))
    channels = (
        *(Channel(axis, "position", (axis,)) for axis in "xyz"),
        Channel("q", "orientation", ("qx", "qy", "qz", "qw"), None, "xyzw"),
        Channel("gripper", "discrete", ("gripper",)),
    )
    named = Demonstrations.of_movements(of_channels(replace(demos.movements, positions=columns), channels))
    primitives = PoseDMP(DMP(n_basis=20)).learn(named)
    primitives = type(primitives).concatenate([primitives[i] for i in range(len(primitives))])
    rollout = primitives.rollout(n_samples=200)
    assert rollout.channels == primitives.to_recording.channels == channels
    recorded = rollout.demonstrations.recorded.reshape(len(demos), 200, 8)
    start, unit = demos.positions[demos.offsets[:-1], None, :3], pose_extents(demos)[:, None, None]
    return each(len(demos), path=(recorded[..., :3] - start) / unit, other=recorded[..., 3:])


def learned_coordinates(demos: Demonstrations) -> list[dict[str, Any]]:
    """Recorded columns as they are learned, and back to columns."""
    channels = (
        *(Channel(axis, "position", (axis,)) for axis in "xyz"),
        Channel("q", "orientation", ("qw", "qx", "qy", "qz"), None, "wxyz"),
    )
    found = as_learned(demos, channels, 6)
    plain = as_learned(found, None, 7)
    return [
        {"rotation": one.positions[:, 3:], "quaternions": again.positions[:, 3:] * np.sign(again.positions[0, 3])}
        for one, again in zip(found, plain, strict=True)
    ]


def tangents(demos: Demonstrations) -> list[dict[str, Any]]:
    """There and back, and the quaternions one by one, with the tool's z axis in the world by two ways."""
    tangent, references = to_tangent(demos)
    back = from_tangent(tangent, references)
    found = []
    for i, (one, turned) in enumerate(zip(tangent, back, strict=True)):
        q = continuous(normalized(turned.positions[:, 3:]))
        found.append(
            {
                "tangent": one.positions[:, 3:],
                "quaternions": q * np.sign(q[0, 0]),
                "reference": references[i],
                "axis": rotated(q, [0.0, 0.0, 1.0]),
                "column": matrices_of(q)[:, :, 2],
            }
        )
    return found


def pose_features(demos: Demonstrations) -> list[dict[str, Any]]:
    rows = PoseFeatures().fit(demos).transform(demos)
    half, unit = rows.shape[1] // 2, pose_extents(demos)[:, None]
    return each(len(demos), positions=rows[:, :half] / (100 * unit), orientations=rows[:, half:] / 100)


def style_row() -> Batched:
    shown = reaches([(60, 0, "even", 0, seed) for seed in range(6)])
    model = styles.learn_styles(DMP(n_basis=15).learn(shown), 3)

    def call(demos: Demonstrations) -> list[dict[str, Any]]:
        found = model.style_of(demos)
        size = 1.0 + extents(demos)
        return each(
            len(demos), styles=found.styles / size[:, None], residuals=found.residuals / size, inside=found.inside
        )

    return Batched("StyleModel.style_of", call, 1e-9)


def stored(demos: Demonstrations) -> list[dict[str, Any]]:
    """Learned into a library and read back; single precision of the distance from the start is what it keeps."""
    with tempfile.TemporaryDirectory() as folder, ActionLibrary(folder, create=True) as library:
        ids = library.learn(demos).ids
        primitives, back = library.primitives(ids=ids), library.movements(ids=ids)
        numbers = learned(demos, primitives)
        rows = library.features(ids)
        return [
            one | read | {"features": row} for one, read, row in zip(numbers, movements(demos, back), rows, strict=True)
        ]


def starts_cut(demos: Demonstrations) -> list[dict[str, Any]]:
    return movements(demos, cut(demos, 0.6))


TABLE = [
    *(
        learn_row(DMP(formulation, 20, fit=fit, gating=gating, n_points=50))
        for formulation in FORMULATIONS
        for fit in FITS
        for gating in GATINGS
    ),
    learn_row(DMP(n_basis=20, regression="ridge", n_points=50)),
    learn_row(DMP(n_basis=15, n_points=37, preprocessing=(TrimRest(), Smooth(8.0), Resample(70)))),
    *(feature_row(formulation, feature, fit) for formulation in FORMULATIONS for feature in FEATURES for fit in FITS),
    feature_row("bio-inspired", "shape-attractor", "forcing", "float32"),
    Batched("Primitives.rollout", rollout_of, 1e-8),
    Batched("Primitives.rollout via", modulated, 1e-8),
    Batched("Primitives.rollout via stretch", along_stretches, 1e-8),
    Batched("couple", coupled, 1e-8),
    Batched("laid_out", parts_in_a_row, 1e-8, alone=6),
    Batched("laid_out_poses", poses_in_a_row, 1e-6, draw=poses, alone=6),
    Batched("Primitives.rollout goal_velocity", to_moving_goals, 1e-8),
    Batched("Primitives.concatenate", concatenated, 1e-8),
    Batched("Primitives.save", saved, 1e-8),
    step_row(Resample(60), 1e-10),
    step_row(Smooth(6.0), 1e-8),
    step_row(TrimRest(0.02), 0.0),
    Batched("resample_by_arc_length", arc, 1e-9),
    Batched("cut", starts_cut, 1e-9),
    *(
        described(scale, translation, cutoff)
        for scale in SCALES
        for translation, cutoff in ((True, 10.0), (False, None))
    ),
    Batched("describe and compare", compared, 2e-5),
    Batched("recorded_values", lambda demos: each(len(demos), values=recorded_values(demos, 0, len(demos))), 1e-9),
    Batched("maps_onto", aligned, 1e-7),
    Batched("Recognizer", recognized, 2e-5),
    recognized_columns(1),
    recognized_columns(4),
    Batched("Recognizer.recognize", answers, 2e-5),
    Batched("Recognizer.predict_partial", partly_seen, 0.0, alone=6),
    *(gram_row(name, kernel, dtype) for name, kernel in kernels() for dtype in ("float64", "float32")),
    *(
        procrustes_row(d, angle, dtype)
        for d, angle in ((1, 0.0), (2, 1.0), (3, 1.0), (3, 4.0 * np.arctan(1.0)))
        for dtype in ("float64", "float32")
    ),
    pairs_row(2),
    pairs_row(3),
    Batched("RandomBinning", binned, 1e-12, draw=rows),
    *(rhythm_row(RhythmicDMP(fit=fit)) for fit in FITS),
    Batched("RhythmicFeatures", rhythmic_features, 1e-6, draw=rhythms),
    Batched("PoseDMP.learn", pose_numbers, 1e-6, draw=poses),
    Batched("PoseDMP.learn of channels", recorded_numbers, 1e-6, draw=poses),
    Batched("as_learned", learned_coordinates, 1e-9, draw=poses),
    Batched("to_tangent", tangents, 1e-12, draw=poses),
    Batched("PoseFeatures", pose_features, 1e-8, draw=poses),
    style_row(),
    Batched("ActionLibrary.learn", stored, 1e-6, alone=3),
    Batched("ActionLibrary.recognize", library_answers, 2e-5),
]
