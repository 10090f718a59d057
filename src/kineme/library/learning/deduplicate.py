"""Find movements of a batch that are stored already: by their samples, or by their position in the same file."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass, field

from kineme.library.learning.serialize import SerializedRows
from kineme.library.storage.rows import among, as_text, listed
from kineme.library.storage.source import Source
from kineme.movements.trajectories.demonstrations import Demonstrations


@dataclass
class Batch:
    """Movements to be stored, with labels and sources; `exact_digests` are those that earlier libraries hold."""

    demos: Demonstrations
    digests: list[int]
    exact_digests: list[int]
    labels: list[str | None]
    groups: list[str | None]
    sources: list[Source | None]
    places: list[str | None]
    serialized: SerializedRows | None = None
    row_of: dict[int, int] = field(default_factory=dict)  # movement of the batch -> row of `serialized`


@dataclass(frozen=True)
class Stored:
    """Which movements and sources of a batch the library holds already, and their keys."""

    by_digest: dict[int, int]
    sources: dict[tuple[str, str], int]  # (sha256, options) -> source
    by_place: dict[tuple[int, str], int]  # (source, place) -> movement

    def id_of(self, batch: Batch, i: int) -> int | None:
        """The id of movement i of the batch; None if it is new."""
        key = self.by_digest.get(batch.digests[i], self.by_digest.get(batch.exact_digests[i]))
        where = self.place_of(batch, i)
        return self.by_place.get(where) if key is None and where is not None else key

    def place_of(self, batch: Batch, i: int) -> tuple[int, str] | None:
        """(source, position in it) of movement i, if its source is stored."""
        source, place = batch.sources[i], batch.places[i]
        key = None if source is None else self.sources.get((source.sha256, source.options_json))
        return None if key is None or place is None else (key, as_text(place))

    def remember(self, batch: Batch, i: int, key: int) -> None:
        """Movement i has been stored: a copy of it later in the batch is not new."""
        self.by_digest[batch.digests[i]] = key
        if (where := self.place_of(batch, i)) is not None:
            self.by_place[where] = key


def find_stored(connection: sqlite3.Connection, batch: Batch) -> Stored:
    """Find the movements of a batch that the library holds already."""
    hashes = {source.sha256 for source in batch.sources if source is not None}
    query = f"SELECT sha256, options, id FROM source WHERE {among('sha256')}"
    rows = connection.execute(query, {"keys": listed(hashes)}) if hashes else ()
    sources = {(sha256, options): key for sha256, options, key in rows}
    query = f"SELECT source, place, id FROM movement WHERE removed IS NULL AND source IS NOT NULL AND {among('source')}"
    rows = connection.execute(query, {"keys": listed(sources.values())}) if sources else ()
    by_place = {(source, place): key for source, place, key in rows}
    return Stored(_by_digest(connection, [*batch.digests, *batch.exact_digests]), sources, by_place)


def _by_digest(connection: sqlite3.Connection, digests: list[int]) -> dict[int, int]:
    query = f"SELECT digest, id FROM movement WHERE removed IS NULL AND {among('digest')}"
    return dict(connection.execute(query, {"keys": listed(digests)}))
