"""Calibrations of libraries, kept in cache files; and the comparison of a large one, fitted to a sample."""

from __future__ import annotations

import hashlib
import io
import math
import zlib
from collections.abc import Callable
from contextlib import suppress
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from kineme.library.members import Members, described_references
from kineme.library.storage.store import Store
from kineme.recognition.conformal import Calibration, calibrate
from kineme.recognition.two_stage_search import calibrate_sample
from kineme.reporting.atomic import write_atomically
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import Comparison, References, StoredReferences, fit_to_references
from kineme.similarity.scores import Classifier
from kineme.similarity.similarity import AveragedSimilarity
from kineme.validation import Array

FILE = "calibration.cache"  # of a large library, by a sample
FILE_OF_ALL = "calibration_of_all.cache"  # of a smaller one, whose members are all compared

_FORMAT = "6"
_FEW = 500  # members of which a calibration takes 0.1 s: computed every time
_SPOILED = (OSError, ValueError, LookupError, EOFError, RuntimeError, MemoryError, BadZipFile, zlib.error)
_SAMPLE = 500  # movements that widths and weights are estimated from, evenly spaced as in `Recognizer.fit`


def sample_comparison(store: Store, members: Members) -> Comparison:
    """Return a comparison with widths and weights that are fitted to a sample of the members."""
    chosen, how = evenly_spaced(len(members.ids), _SAMPLE), store.specification
    references = described_references(store, members.ids[chosen], members.labels[chosen])
    return fit_to_references(how.comparison, references, how.weights, store.channels)[0]


def calibrated(store: Store, members: Members, similarity: AveragedSimilarity, stored: StoredReferences) -> Calibration:
    """Return the calibration on all members, taken from the cache if that is of the same ones."""
    return _cached(store, FILE, members, lambda: calibrate_sample(similarity, stored, members.groups))


def calibrated_once(
    store: Store,
    members: Members,
    similarity: AveragedSimilarity,
    references: References,
    groups: NDArray[np.intp] | None,
    classifier: Classifier,
) -> Calibration:
    """Return `conformal.calibrate` of the members, from a cache of its own; of few, it is computed every time."""
    if len(members.ids) < _FEW:
        return calibrate(similarity, references, groups, classifier)
    return _cached(store, FILE_OF_ALL, members, lambda: calibrate(similarity, references, groups, classifier))


def _cached(store: Store, name: str, members: Members, make: Callable[[], Calibration]) -> Calibration:
    """Return the calibration in that file of the folder, if it is of these members; else made, and written there."""
    path, key = store.cache_path(name), _key(store, members)
    if path is not None and path.is_file():  # not a pipe, which would block
        with suppress(*_SPOILED):
            return _deserialized(path.read_bytes(), key, len(members.names))
    calibration = make()
    if path is not None and not store.read_only:
        with suppress(OSError):  # disk full or no permission: it is computed again next time
            write_atomically(path, _serialized(calibration, key))
    return calibration


def _key(store: Store, members: Members) -> str:
    """Cache validity key: changes with the library, its specification, members and people.

    Ids are never reused, but a backup that is put back may give them to other movements. When the last member was
    stored tells these apart, and with it all earlier ones.
    """
    with store.reading() as connection:
        query = "SELECT at FROM version WHERE id = (SELECT added FROM movement WHERE id = :last)"
        at = connection.execute(query, {"last": int(members.ids.max())}).fetchall()
    text = [_FORMAT, store.id, str(at), *store.specification.to_json().values(), *map(str, members.names)]
    digest = hashlib.sha256("\0".join(text).encode())
    digest.update(members.ids.tobytes() + members.first.tobytes())
    digest.update(b"" if members.groups is None else members.groups.tobytes())
    return digest.hexdigest()


def _serialized(calibration: Calibration, key: str) -> bytes:
    both = list(zip(calibration.pooled, calibration.pooled_novelties, strict=True))
    pooled = {(id(score), id(novelty)): (score, novelty) for score, novelty in both}  # classes of one size share arrays
    numbers = {name: k for k, name in enumerate(pooled)}
    arrays: dict[str, Any] = {f"pooled {k}": score for k, (score, _) in enumerate(pooled.values())}
    arrays |= {f"novelties {k}": novelty for k, (_, novelty) in enumerate(pooled.values())}
    arrays["which"] = np.array([numbers[id(score), id(novelty)] for score, novelty in both])
    for name, several in (("", calibration.own), ("novel ", calibration.own_novelties)):
        arrays |= {f"{name}own": np.concatenate(several), f"{name}ends": np.cumsum([len(scores) for scores in several])}
    file = io.BytesIO()
    np.savez(file, scales=calibration.scales, two=[calibration.between, calibration.exponent], **arrays)
    return _seal(file.getvalue(), key) + file.getvalue()


def _seal(data: bytes, key: str) -> bytes:
    """Return the checksum of the bytes and the key."""
    return hashlib.sha256(key.encode() + data).digest()


def _deserialized(data: bytes, key: str, n: int) -> Calibration:
    """Return the calibration of n classes; a ValueError or KeyError if invalid: anybody can compute the checksum."""
    data, seal = data[32:], data[:32]
    if seal != _seal(data, key):
        raise ValueError("damaged, or of other members")
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        which = _indices(arrays["which"], n, n)
        pooled, novelties = (
            [_real(arrays[f"{name} {k}"]) for k in range(int(which.max()) + 1)] for name in ("pooled", "novelties")
        )
        scales, (between, exponent) = _real(arrays["scales"]), _real(arrays["two"]).tolist()
        own, own_novelties = (_split(arrays[f"{name}own"], arrays[f"{name}ends"], n) for name in ("", "novel "))
    if (
        scales.shape != (n,)
        or not ((scales > 0) & np.isfinite(scales)).all()
        or not (0 <= between < math.inf and 0 < exponent < math.inf)
    ):
        raise ValueError("no calibration")
    every = tuple(pooled[k] for k in which), tuple(novelties[k] for k in which)
    return Calibration(scales, own, every[0], own_novelties, every[1], between, exponent)


def _split(scores: NDArray[Any], ends: NDArray[Any], n: int) -> tuple[Array, ...]:
    """Return the scores of each of n classes."""
    scores, ends = _real(scores), _indices(ends, n, len(scores))
    if (np.diff(ends) < 0).any() or ends[-1] != len(scores):
        raise ValueError("no calibration")
    return tuple(np.split(scores, ends[:-1]))


def _indices(array: NDArray[Any], n: int, end: int) -> NDArray[Any]:
    if array.shape != (n,) or array.dtype.kind not in "iu" or (array < 0).any() or (array > end).any():
        raise ValueError("no calibration")
    return array


def _real(array: NDArray[Any]) -> Array:
    if array.ndim != 1 or array.dtype != np.float64 or not (array >= 0).all():  # NaN is not
        raise ValueError("no calibration")
    return array
