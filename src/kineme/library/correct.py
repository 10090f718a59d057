"""Corrections of annotations by a person, as examples: what was changed is learned, what was left as it was is not."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any, NamedTuple
from unicodedata import normalize

import numpy as np

from kineme.errors import DataError
from kineme.io.reading.merge_files import Recordings
from kineme.io.reading.pieces import is_episodic
from kineme.io.reading.read_labels import LabelRow, LabelTable, Stretch, cut_stretches, stretches_of
from kineme.io.records import Problem
from kineme.io.writing.annotations import Annotation
from kineme.library.learn import learn_recordings, stored_ids
from kineme.library.storage import changes as storage
from kineme.library.storage.read import names_of
from kineme.library.storage.rows import among, listed, select
from kineme.library.storage.store import Store
from kineme.library.storage.symbols import spellings
from kineme.movements.episodes import place_of
from kineme.reporting.text import printable

_ENDING = "-corrections.csv"
_SAME = 1  # samples by which both ends of a stretch may differ from those annotated: files round times
_MOVED = 0.3  # intersection over union from which a stretch is one that was annotated, with other boundaries

#: Kind of change -> what a person did.
CHANGES = {
    "named": "unknown motion has a name",
    "renamed": "another symbol",
    "moved": "the same symbol, with other boundaries",
    "added": "a movement where none was annotated",
    "removed": "annotated, and not there any more",
    "unnamed": "a symbol that became unknown",
}
_STRETCH = re.compile(r"(?:(.*) )?(-?[\d.]+)-(-?[\d.]+) s", re.DOTALL)  # place of a movement that was cut
_HALF = 0.5  # intersection over union from which an example shows the same stretch as a row
_LEARNED = ("named", "renamed", "moved", "added")


class Change(NamedTuple):
    """A stretch of a recording that a person changed."""

    kind: str  # one of `CHANGES`
    stretch: Stretch  # as it is now; of a removed one, as it was
    was: str | None  # symbol before, None if it was unknown or not there

    @property
    def learned(self) -> bool:
        """True if it is an example of a symbol."""
        return self.kind in _LEARNED


class Corrections(NamedTuple):
    """All changes in the recordings that a person looked at."""

    changes: list[Change]  # in the order of recordings and time
    unchanged: int  # stretches that are as annotated
    problems: list[Problem]  # rows that are no stretch of the recordings
    stretches: list[Stretch]  # all that the person left

    @property
    def examples(self) -> list[Stretch]:
        """Stretches to learn."""
        return [change.stretch for change in self.changes if change.learned]


def corrections_beside(recordings: Path) -> Path:
    """Return where the studio writes corrections: ``demos-corrections.csv`` beside ``demos`` or ``demos.csv``."""
    # Beside a link, not what it leads to; two dots and nothing are no names.
    path = recordings.resolve() if recordings.name in {"", ".."} else recordings.absolute()
    return path.with_name(f"{path.name if path.is_dir() else path.stem}{_ENDING}")


def as_labels(annotations: Sequence[Annotation]) -> LabelTable:
    """Return annotations as a table of labels, by the clock of the recordings."""
    rows = [
        LabelRow(note.start, note.end, note.symbol, note.recording, note.place, line)
        for line, note in enumerate(annotations, 1)
    ]
    return LabelTable("annotations", tuple(rows), since_start=False)


def motions_in(path: Path) -> list[Annotation]:
    """Return what `kineme annotate` wrote into a data set, by the places of its episodes; [] for all else."""
    if not is_episodic(path):
        return []
    from kineme.io.lerobot.motions import read_motions

    return [
        Annotation("", place_of(motion.episode), *motion[1:4], motion.p_value, motion.confidence)
        for motion in read_motions(path)
        if motion.annotator == "kineme"
    ]


def corrections_of(
    recordings: Recordings, corrected: LabelTable, annotated: LabelTable, root: Path | None = None
) -> Corrections:
    """Compare what a person left with what was annotated, in the recordings below `root` that `corrected` has rows of.

    A stretch is as annotated if symbol and ends are the same, to one sample; others, by which shares most of the union.
    """
    after, problems = stretches_of(recordings, corrected, root)
    if not after:
        first = f"; the first: {problems[0]}" if problems else ""
        raise DataError(f"expected corrections {corrected.name} of the recordings, got none{first}")
    before = stretches_of(recordings, annotated, root)[0] if annotated.rows else []
    symbols = dict.fromkeys(row.label for row in annotated.rows if row.label is not None)
    changes: list[Change] = []
    unchanged = 0
    for recording in sorted({stretch.recording for stretch in after}):
        old = [stretch for stretch in before if stretch.recording == recording]
        replaced: set[int] = set()
        for new in sorted(stretch for stretch in after if stretch.recording == recording):
            shares = [_shared(new, stretch) for stretch in old]
            best = max(range(len(old)), key=shares.__getitem__, default=-1)
            near = old[best] if best >= 0 and shares[best] >= _MOVED else None
            if near is not None:
                replaced.add(best)
            new = _as_annotated(new, near, symbols)  # noqa: PLW2901
            ends = 0 if near is None else max(abs(near.start - new.start), abs(near.stop - new.stop))
            if near is not None and near.row.label == new.row.label and ends <= _SAME:
                unchanged += 1
            elif (kind := _kind(near, new)) is not None:
                changes.append(Change(kind, new, None if near is None else near.row.label))
        changes += [
            Change("removed", stretch, stretch.row.label)
            for k, stretch in enumerate(old)
            if k not in replaced and stretch.row.label is not None
        ]
    return Corrections(changes, unchanged, problems, after)


def _shared(a: Stretch, b: Stretch) -> float:
    """Return intersection over union."""
    both = min(a.stop, b.stop) - max(a.start, b.start)
    return max(both, 0) / (max(a.stop, b.stop) - min(a.start, b.start))


def _as_annotated(new: Stretch, near: Stretch | None, symbols: Collection[str]) -> Stretch:
    """Return a stretch with the symbol that was annotated, in whatever way its file writes that: first the near one."""
    row, was = new.row, None if near is None else near.row.label
    others = () if row.label is None or row.label in symbols else symbols
    texts = {*spellings(row.text)}
    new_name = None if row.label is None else normalize("NFC", row.label)
    symbol = next((name for name in (was, *others) if name is not None and texts & _written(name)), new_name)
    return new._replace(row=row._replace(label=symbol))


def _written(symbol: str) -> set[str]:
    """Return how files have a symbol: without blanks around it, on one line as of ELAN, without tabs as of Audacity."""
    return {symbol.strip(), printable(symbol).strip(), " ".join(printable(symbol).split()), " ".join(symbol.split())}


def _kind(near: Stretch | None, new: Stretch) -> str | None:
    """Return the kind of a change; None for motion that was unknown, or not annotated, and has no name still."""
    was, now = None if near is None else near.row.label, new.row.label
    if now is None:
        return None if was is None else "unnamed"
    if near is None:
        return "added"
    return "named" if was is None else "moved" if was == now else "renamed"


class Learned(NamedTuple):
    """What became of the examples of corrections."""

    added: int  # new movements
    moved: int  # those that the library held under another symbol
    duplicates: int  # examples that it held, also those that moved


def learn_corrections(
    store: Store,
    recordings: Recordings,
    corrections: Corrections,
    options: Mapping[str, Any] | None = None,
    root: str | PurePath = "",
    dry_run: bool = False,
) -> Learned:
    """Learn the examples of corrections, or only tell what that would do.

    Examples that the library holds under another symbol, since they were corrected before, join the symbol that they
    have now. One undo takes back all of it.
    """
    examples = corrections.examples
    if not examples:
        return Learned(0, 0, 0)
    pieces, before = cut_stretches(recordings, examples), store.version
    if dry_run:
        ids = stored_ids(store, pieces, options, root)
        added, version = len(np.unique(ids[ids < 0])), before
    else:
        report = learn_recordings(store, pieces, options, root=root)
        ids, added, version = report.ids, report.added, report.version
    moving: dict[str, set[int]] = {}
    for key, stretch, name in zip(ids.tolist(), examples, names_of(store, ids), strict=True):
        if name is not None and name != stretch.row.label:
            moving.setdefault(str(stretch.row.label), set()).add(key)
    for symbol, keys in ({} if dry_run else moving).items():
        version = storage.assign(store, sorted(keys), symbol, "label", continues=version if version > before else None)
    return Learned(added, sum(map(len, moving.values())), len(examples) - added)


class Contradicted(NamedTuple):
    """An example in the library that shows another symbol than a person left, or has other ends."""

    movement: int  # its id
    symbol: str
    start: float  # [s], and so is the end
    end: float
    stretch: Stretch  # as the person left it


def contradicted(store: Store, recordings: Recordings, corrections: Corrections) -> list[Contradicted]:
    """Return the examples of the same recordings that a stretch contradicts: learned before a slip was mended."""
    hashes = {recordings.sources[stretch.recording].sha256 for stretch in corrections.stretches}
    with store.reading() as connection:
        files = {row[0]: row[2] for row in select(connection, "source", among("sha256"), {"keys": listed(hashes)})}
        where = f"removed IS NULL AND {among('source')}"
        rows = select(connection, "movement", where, {"keys": listed(files)})
    names = names_of(store, np.array([row[0] for row in rows], dtype=np.int64))
    examples: dict[tuple[str, str], list[tuple[int, str, float, float]]] = {}
    for (key, source, place, *_), name in zip(rows, names, strict=True):
        if name is not None and (cut := _STRETCH.fullmatch(place or "")):
            examples.setdefault((files[source], cut[1] or ""), []).append((key, name, float(cut[2]), float(cut[3])))
    learned = {*corrections.examples}
    contradictions: list[Contradicted] = []
    for recording in sorted({stretch.recording for stretch in corrections.stretches}):
        source, offsets = recordings.sources[recording], recordings.demonstrations.offsets
        times = recordings.demonstrations.times[offsets[recording] : offsets[recording + 1]]
        own = [stretch for stretch in corrections.stretches if stretch.recording == recording]
        for key, name, start, end in examples.get((source.sha256, source.place), ()):
            # Places round times: the nearest sample is meant.
            first, last = (int(np.abs(times - time).argmin()) for time in (start, end))
            example = Stretch(recording, first, last + 1, own[0].row)
            now = max(own, key=lambda stretch: _shared(stretch, example))
            ends = max(abs(now.start - first), abs(now.stop - last - 1))
            joins = now in learned and ends == 0  # in a dry run it has not yet
            if _shared(now, example) > _HALF and not joins and (name != now.row.label or ends > _SAME):
                contradictions.append(Contradicted(key, name, start, end, now))
    return contradictions
