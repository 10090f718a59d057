"""The nearest movements among all of an archive, whose features lie in shards: two stages, the first one exact.

First the movements with the largest bounds of the similarity, see `kineme.pieces.scan`, whatever shards they lie in; of
equal ones the first by path, place and start. These are then compared by all representations.

Indexes hold the rows of some shards, in the order in which they are searched, in files beside them, or in memory where
nothing can be written. Their names say of which shards they are; processes share their arrays.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.pieces.scan import BLOCK, Best, Index, Plan, Query, Rows, Single, best_of, plan_of, scan
from kineme.pieces.shards import PATTERN, Reduction, Shard, open_shard, read_reduction
from kineme.recognition.answer import Answer
from kineme.reporting.atomic import whole_folder
from kineme.runtime.compiled import load_compiled
from kineme.runtime.parallel import for_tiles, n_threads
from kineme.similarity.bounds import reduce_features
from kineme.similarity.describe import Described, feature_rows
from kineme.validation import check_count

CANDIDATES = 256  # movements that are compared by all representations
MOST_CANDIDATES = 100_000  # the same at most

_DECIMALS = 6  # of logarithms of similarities: movements that are closer are equally near
_WRONG = 1e-2  # share of a norm by which reduced features may differ from those of the feature rows beside them
FOLDER = "search-"  # and a checksum
_FORMAT = 1
MOST = 2**20  # rows of an index, unless one shard has more
_OFF = 1e-4  # of a square: reduced features and residual are farther from it than rounding


class Near(NamedTuple):
    """A movement that is near."""

    path: str  # the file, relative to its archive
    place: str  # which movement of it; empty if it holds but one
    start: float  # in the time of the file [s]
    duration: float
    label: str | None  # that the file gives it
    similarity: float  # averaged kernel, from 0 to 1


class Candidates(NamedTuple):
    """The best movements by their bounds, in any order."""

    scores: Single  # (k,), logarithms
    shards: NDArray[np.intp]  # (k,), their numbers
    rows: NDArray[np.intp]  # (k,), in the shard

    def take(self, chosen: NDArray[np.intp]) -> Candidates:
        """Return the chosen ones."""
        return Candidates(self.scores[chosen], self.shards[chosen], self.rows[chosen])


@dataclass(frozen=True, eq=False)
class Shards:
    """The movements of the shards in a folder; made by `open_shards`. Threads may share it."""

    folder: Path
    reduction: Reduction
    shards: tuple[Shard, ...]
    most: int = MOST  # rows that are indexed together
    progress: Callable[[int, int], object] | None = None  # called with the movements that are indexed, and all

    def __len__(self) -> int:
        return sum(map(len, self.shards))

    def __repr__(self) -> str:
        n = len(self.shards)
        return f"Shards({str(self.folder)!r}: {len(self):,} movements in {n:,} shard{'s' * (n != 1)})"

    @cached_property
    def plan(self) -> tuple[Plan, list[int]]:
        """How reduced features are compared, and the numbers of the representations of which they are."""
        comparison = self.reduction.comparison
        by_rows = comparison.specification.by_rows
        numbers = [self.reduction.specification.by_rows.index(representation) for representation in by_rows]
        counts = [self.reduction.bases[r].shape[1] for r in numbers]
        plan, chosen = plan_of(comparison.similarity.by_rows(len(by_rows)), counts)
        return plan, [numbers[r] for r in chosen]

    @cached_property
    def groups(self) -> tuple[tuple[int, Group], ...]:
        """The indexes, each with the number of its first shard; made, which takes a while, where there are none."""
        groups = []
        for each in groups_of(self.shards, self.most):
            shards = self.shards[each.start : each.stop]
            groups.append((each.start, open_group(self.folder, *self.plan, self.reduction, shards)))
            if self.progress is not None:
                self.progress(sum(map(len, self.shards[: each.stop])), len(self))
        return tuple(groups)

    def prepare(self) -> None:
        """Make the indexes now, and remove those of shards that are there no more."""
        self.groups  # noqa: B018 - made on use
        groups = [self.shards[each.start : each.stop] for each in groups_of(self.shards, self.most)]
        used = {f"{FOLDER}{_key(*self.plan, self.reduction, shards)}" for shards in groups}
        for path in self.folder.glob(f"{FOLDER}*"):
            if path.name not in used:
                shutil.rmtree(path, ignore_errors=True)

    def nearest(self, movements: MovementsLike, n: int = 10, candidates: int = CANDIDATES) -> list[list[Near]]:
        """Return the `n` nearest of all movements to each of some in the columns of the library.

        The nearest is first; of equally near ones the first by path, place and start. At least n `candidates` are
        compared by all representations. Raises `TrajectoryError`: movements of other columns than those of the library.
        Raises `DataError`: feature rows that are damaged.
        """
        check_count("n", n, 1, most=MOST_CANDIDATES)
        check_count("candidates", candidates, n, most=MOST_CANDIDATES)
        described, queries = self.described(movements)
        return self.ranked(described, self.candidates(queries, candidates), n)

    def described(self, movements: MovementsLike) -> tuple[Described, list[Query]]:
        """Return movements ready for comparison, and for the first stage."""
        comparison = self.reduction.comparison
        plan, chosen = self.plan
        rows = feature_rows(comparison.checked(movements), comparison.specification)
        by_rows = comparison.specification.by_rows
        used = [by_rows.index(self.reduction.specification.by_rows[r]) for r in chosen]
        bases = tuple(self.reduction.bases[r] for r in chosen)
        reduced = reduce_features(bases, tuple(rows[r] for r in used), comparison.n_dims)
        parts = [arranged(plan, np.column_stack(features)) for features in reduced]
        return comparison.prepared(rows), plan.queries(np.concatenate(parts, axis=1))

    def candidates(
        self, queries: Sequence[Query], k: int = CANDIDATES, groups: Iterable[int] | None = None
    ) -> list[Candidates]:
        """Return the k movements with the largest bounds for each query, among all or in some of the groups."""
        chosen = range(len(self.groups)) if groups is None else list(groups)
        parts = max(1, min(len(chosen), n_threads() // max(1, len(queries))))
        tops = [[best_of(k) for _ in range(parts)] for _ in queries]

        def work(start: int, stop: int) -> None:
            for task in range(start, stop):
                i, p = divmod(task, parts)
                self._scan(queries[i], tops[i][p], chosen[p::parts])

        for_tiles(work, len(queries) * parts, 1)
        return [self._complete(query, top, k, chosen) for query, top in zip(queries, tops, strict=True)]

    def _scan(self, query: Query, best: Best, chosen: Sequence[int]) -> None:
        firsts = self._firsts
        for g in chosen:
            scan(self.plan[0], self.groups[g][1].rows, query, best, int(firsts[g]))

    @cached_property
    def _firsts(self) -> NDArray[np.intp]:
        """The number of the first row of each group, and that of all rows."""
        return np.cumsum([0, *(len(group.rows.reduced) for _, group in self.groups)])

    def _complete(self, query: Query, tops: Sequence[Best], k: int, chosen: Sequence[int]) -> Candidates:
        """Return the best of all parts; with more room if rows as good as the last one had no place."""
        room = k
        while True:
            scores, rows = (np.concatenate(parts) for parts in list(zip(*tops, strict=True))[:2])
            scores, rows = scores[rows >= 0], rows[rows >= 0]
            if len(scores) < k or max(best.state[1] for best in tops) < np.partition(scores, -k)[-k]:
                break
            room *= 4
            tops = [best_of(room)]
            self._scan(query, tops[0], chosen)
        owners = np.searchsorted(self._firsts, rows, side="right") - 1
        shards, places = np.empty(len(rows), np.intp), np.empty(len(rows), np.intp)
        for g in np.unique(owners).tolist():
            own = owners == g
            first, group = self.groups[g]
            inside = rows[own] - self._firsts[g]
            shards[own], places[own] = first + group.shards[inside], group.places[inside]
        return self.best([Candidates(scores, shards, places)], k)

    def best(self, parts: Sequence[Candidates], k: int) -> Candidates:
        """Return the k best of several; of equal ones the first by path, place and start."""
        scores, shards, rows = (np.concatenate(part) for part in zip(*parts, strict=True))
        every = Candidates(scores, shards, rows)
        if len(every.scores) <= k:
            return every
        least = np.partition(every.scores, -k)[-k]
        better, equal = np.flatnonzero(every.scores > least), np.flatnonzero(every.scores == least)
        if len(better) + len(equal) > k:
            names = self.names(every.take(equal))
            equal = equal[sorted(range(len(equal)), key=names.__getitem__)]
        return every.take(np.concatenate((better, equal[: k - len(better)])))

    def names(self, chosen: Candidates) -> list[tuple[str, str, float]]:
        """Return path, place and start of movements."""
        return list(zip(*(self._column(chosen, name) for name in ("path", "place", "start")), strict=True))

    def _column(self, chosen: Candidates, name: str) -> Any:
        """Return a column at the chosen movements: lists of numbers as an array, others as a list."""
        order = np.argsort(chosen.shards, kind="stable")
        parts = np.split(order, np.flatnonzero(np.diff(chosen.shards[order])) + 1)
        taken = [self.shards[chosen.shards[part[0]]].take(chosen.rows[part], name) for part in parts]
        back = np.argsort(order)
        if isinstance(taken[0], np.ndarray):
            return np.concatenate(taken)[back]
        flat = [value for values in taken for value in values]
        return [flat[i] for i in back]

    def ranked(self, described: Described, candidates: Sequence[Candidates], n: int) -> list[list[Near]]:
        """Return the n candidates of each movement that are most similar by all representations."""
        every = Candidates(*(np.concatenate(part) for part in zip(*candidates, strict=True)))
        for number in np.unique(every.shards).tolist():
            self.shards[number].will_need(np.unique(every.rows[every.shards == number]))
        ranked: list[list[Near]] = [[] for _ in candidates]

        def work(start: int, stop: int) -> None:
            for i in range(start, stop):
                ranked[i] = self._ranked(described.take(slice(i, i + 1)), candidates[i], n)

        for_tiles(work, len(candidates), 1)
        return ranked

    def _ranked(self, movement: Described, candidates: Candidates, n: int) -> list[Near]:
        if not len(candidates.rows):
            return []
        names = self.names(candidates)
        order = sorted(range(len(names)), key=names.__getitem__)
        candidates, names = candidates.take(np.array(order)), [names[i] for i in order]
        comparison = self.reduction.comparison
        others = comparison.prepared(self._rows(candidates))
        logs = np.round(comparison.similarity.log_average(movement, others)[0], _DECIMALS)
        nearest = np.argsort(-logs, kind="stable")[:n]
        chosen = candidates.take(nearest)
        durations, labels = self._column(chosen, "duration"), self._column(chosen, "label")
        similarities = np.exp(logs[nearest]).tolist()
        about = [names[i] for i in nearest.tolist()]
        parts = zip(about, durations, labels, similarities, strict=True)
        return [Near(path, place, start, *others) for (path, place, start), *others in parts]

    def _rows(self, chosen: Candidates) -> tuple[Single, ...]:
        """Return the feature rows of movements, which have to fit their reduced features."""
        specification, comparison = self.reduction.specification, self.reduction.comparison
        widths = [comparison.n_dims * representation.n_points for representation in specification.stored_rows]
        blocks = np.split(self._column(chosen, "rows"), np.cumsum(widths)[:-1], axis=1)
        reduced = self._column(chosen, "reduced")
        again = reduce_features(self.reduction.bases, tuple(blocks[: len(self.reduction.bases)]), comparison.n_dims)
        for column, features in zip(self.reduction.columns(), again, strict=True):
            away = np.linalg.norm(reduced[:, column][:, :-2] - features.values, axis=1)
            if wrong := np.flatnonzero(~(away <= _WRONG * np.sqrt(features.squares) + 1e-6)).tolist():
                path = self.shards[chosen.shards[wrong[0]]].path
                raise DataError(
                    f"expected feature rows in {path} that give the reduced features beside them, got others in row "
                    f"{chosen.rows[wrong[0]]}; remove the shard, and write it again by kineme features"
                )
        held = dict(zip(specification.stored_rows, blocks, strict=True))
        return tuple(held[representation] for representation in comparison.specification.stored_rows)


def as_dict(
    shards: Shards, candidates: int, ranked: Sequence[Sequence[Near]], answers: Sequence[Answer | None]
) -> dict[str, Any]:
    """Return the nearest of some movements, and what a library recognizes them as, as ``nearest.schema.json`` says."""
    recognized = [
        None
        if answer is None
        else {"label": answer.to_dict()["label"], "certainty": answer.certainty, "confidence": float(answer.confidence)}
        for answer in answers
    ]
    pairs = zip(recognized, ranked, strict=True)
    listed = [{"recognized": answer, "nearest": [near._asdict() for near in nearest]} for answer, nearest in pairs]
    return {"movements": len(shards), "candidates": candidates, "answers": listed}


def open_shards(folder: str | Path) -> Shards:
    """Open the shards in a folder, which `kineme features` has written, for searching.

    What is needed to search fast is made at the first search, some seconds for a million movements, and kept beside
    the shards in folders ``search-...``. Raises `DataError`: no shards, damaged ones, or some of other bases or of
    another library.
    """
    load_compiled()  # so that answers do not depend on what was computed before
    place = Path(folder)
    reduction = read_reduction(place)
    shards = [open_shard(path, reduction) for path in sorted(place.glob(PATTERN))]
    if not any(map(len, shards)):
        raise DataError(
            f"expected shards of movements in {place}, got {len(shards)} files {PATTERN} without any; write them by: "
            f"kineme features ARCHIVE --library LIBRARY -o {place}"
        )
    return Shards(place, reduction, tuple(shard for shard in shards if len(shard)))


class Group(NamedTuple):
    """Some shards that are searched together."""

    rows: Index
    shards: NDArray[np.int32]  # (n,), number of the shard of each row
    places: Rows  # (n,), row in the shard


def groups_of(shards: Sequence[Shard], most: int) -> list[range]:
    """Return numbers of the shards of each group: neighbors, of at most so many rows or one shard."""
    groups, first, total = list[range](), 0, 0
    for number, shard in enumerate(shards):
        if total and total + len(shard) > most:
            groups, first, total = [*groups, range(first, number)], number, 0
        total += len(shard)
    return [*groups, range(first, len(shards))] if total else groups


def open_group(folder: Path, plan: Plan, chosen: list[int], reduction: Reduction, shards: Sequence[Shard]) -> Group:
    """Return the index of shards, from its files or made; shards are numbered from 0, `chosen` are representations."""
    path = folder / f"{FOLDER}{_key(plan, chosen, reduction, shards)}"
    names = (*Index._fields, *Group._fields[1:])
    with suppress(OSError, ValueError, EOFError):  # none there, or damaged: it is made
        arrays = [np.load(path / f"{name}.npy", mmap_mode="r") for name in names]
        group = Group(Index(*arrays[:4]), *arrays[4:])
        if _fits(group, plan, shards):
            return group
    group = _made(plan, chosen, reduction, shards)
    with suppress(OSError):
        if path.is_dir():
            shutil.rmtree(path)
        with whole_folder(path) as beside:
            arrays = [*group.rows, group.shards, group.places]
            for name, array in zip(names, arrays, strict=True):
                np.save(beside / f"{name}.npy", array)
        arrays = [np.load(path / f"{name}.npy", mmap_mode="r") for name in names]
        return Group(Index(*arrays[:4]), *arrays[4:])
    return group


def _key(plan: Plan, chosen: list[int], reduction: Reduction, shards: Sequence[Shard]) -> str:
    files = [(shard.path.name, shard.path.stat()) for shard in shards]
    states = [(name, status.st_size, status.st_mtime_ns) for name, status in files]
    said = repr((_FORMAT, BLOCK, reduction.digest, chosen, plan.kind, plan.n_marks, states))
    return hashlib.sha256(said.encode()).hexdigest()[:24]


def _fits(group: Group, plan: Plan, shards: Sequence[Shard]) -> bool:
    """Tell whether arrays are of the right shapes, and point to rows that are there."""
    n, width, n_marks = sum(map(len, shards)), int(plan.begins[-1]), sum(plan.n_marks)
    blocks = -(-n // BLOCK)
    shapes = [(blocks, n_marks, BLOCK), (blocks, n_marks), (blocks, n_marks), (n, width), (n,), (n,)]
    arrays = (*group.rows, *group[1:])
    if [array.shape for array in arrays] != shapes or any(array.dtype != np.float32 for array in group.rows):
        return False
    lengths = np.array([len(shard) for shard in shards])
    inside = (group.shards >= 0) & (group.shards < len(shards)) & (group.places >= 0)
    return bool(inside.all() and (group.places < lengths[group.shards]).all())


def _made(plan: Plan, chosen: list[int], reduction: Reduction, shards: Sequence[Shard]) -> Group:
    columns = [reduction.columns()[r] for r in chosen]
    lengths = [len(shard) for shard in shards]
    reduced = np.empty((sum(lengths), plan.begins[-1]), dtype=np.float32)
    done = 0
    for shard in shards:
        shard.advise("SEQUENTIAL")
        for block in shard.numbers["reduced"]:
            _check(block, reduction, shard.path)
            part = reduced[done : done + len(block)]
            part[:] = np.concatenate([arranged(plan, block[:, column]) for column in columns], axis=1)
            done += len(block)
        shard.advise("RANDOM")
    index, order = plan.index(reduced)
    owners = np.repeat(np.arange(len(shards), dtype=np.int32), lengths)
    rows = np.concatenate([np.arange(length) for length in lengths])
    return Group(index, owners[order], rows[order])


def arranged(plan: Plan, reduced: Single) -> Single:
    """Return reduced features of a representation (n, d k + 2) with the x of all points first."""
    if plan.procrustes.n_points == 1:
        return reduced
    return np.column_stack((plan.procrustes.by_coordinates(reduced[:, :-2]), reduced[:, -2:]))


def _check(block: Single, reduction: Reduction, path: Path) -> None:
    """Refuse reduced features that are not finite, or whose squares are not those of their parts."""
    for column in reduction.columns():
        part = block[:, column].astype(np.float64)
        squares = np.einsum("ij,ij->i", part[:, :-2], part[:, :-2]) + part[:, -1] ** 2
        wrong = ~(np.abs(part[:, -2] - squares) <= _OFF * np.maximum(part[:, -2], squares)) | (part[:, -1] < 0)
        if wrong.any():
            raise DataError(
                f"expected reduced features in {path}, got damaged ones in {int(wrong.sum()):,} of {len(block):,} "
                "rows; remove the shard, and write it again by kineme features"
            )
