"""`ActionLibrary`, a thin class over the functions of this chapter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, wraps
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, Any, Self, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import SpecificationError
from kineme.library.storage import changes, export_import, read, symbols, undo, verify
from kineme.library.storage.address import Address, as_location
from kineme.library.storage.connection import FILE
from kineme.library.storage.read import Ids
from kineme.library.storage.specification import Specification
from kineme.library.storage.store import Store, history
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.reporting.page import thumbnail
from kineme.reporting.table import Table, to_html

if TYPE_CHECKING:
    from kineme.anchoring.proposals import Proposal
    from kineme.anchoring.space import Between, Near
    from kineme.dmp.discrete.dmp import DMP, Primitives
    from kineme.library.learn import LearnReport
    from kineme.library.proposals import LibraryProposals, Review
    from kineme.library.recognize import LibraryRecognizer
    from kineme.library.storage.source import Source
    from kineme.library.storage.store import Version
    from kineme.library.storage.symbols import Symbol
    from kineme.library.storage.undo import Undone
    from kineme.library.storage.verify import Problem
    from kineme.movements.channels.channel import Channels
    from kineme.movements.trajectories.demonstrations import Demonstrations
    from kineme.movements.trajectories.trajectory import HasDemonstrations, Trajectory
    from kineme.recognition.answer import Answer
    from kineme.recognition.early.hypotheses import Early
    from kineme.recognition.early.stream import Live
    from kineme.recognition.monitor import Monitor
    from kineme.recognition.recognizer import Recognizer

_LISTED = 20  # symbols that a notebook shows


def _blaming(cls: type[ActionLibrary]) -> type[ActionLibrary]:
    """Let every public method of a library blame a file whose rows do not fit together; see `verify.blame`."""

    def guarded(method: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(method)
        def call(self: ActionLibrary, *arguments: Any, **options: Any) -> Any:
            try:
                return method(self, *arguments, **options)
            except verify.MISFITS as error:
                verify.blame(self.store, error)
                raise

        return call

    for name, method in list(vars(cls).items()):
        if isinstance(method, FunctionType) and not name.startswith("_"):
            setattr(cls, name, guarded(method))
    return cls


def _store_at(folder: str | Path | Address) -> tuple[type[Store], Path | Address]:
    """Return the kind of store of a folder or an address, and the path of its file, or the address."""
    location = as_location(folder)
    if isinstance(location, Path):
        return Store, location / FILE
    from kineme.library.storage.postgres_store import PostgresStore

    return PostgresStore, location


def is_library(folder: str | Path | Address) -> bool:
    """Tell whether a library is in a folder, or at an address."""
    kind, location = _store_at(folder)
    return kind.exists(location)


@_blaming
class ActionLibrary:
    """Movements, their primitives and features, and the symbols they stand for, in one folder or on a server.

    Parameters
    ----------
    folder : str or Path
        Folder of the database ``library.sqlite``. Or, as text, ``postgresql://user@host/database?schema=name``: a
        schema, by default "kineme", of a database on a PostgreSQL server, where many learn at once.
    create : bool, default False
        Create the library if it does not exist.
    read_only : bool, default False
        Write nothing, not even caches; works in a read-only folder.
    recognizer : Recognizer, optional
        How movements are described and compared in a new library; by default ``Recognizer()``.
    dmp : DMP, optional
        Specification of the primitives in a new library; by default bio-inspired, 40 basis functions, fitted to the
        path.
    wait : float, default 10.0
        Seconds to wait while another process writes, before an error.

    Raises
    ------
    DataError
        No library in the folder, another program's file, damaged bytes, a later schema version, no permission.
    SpecificationError
        The library exists and was created with another recognizer or dmp.

    Notes
    -----
    One process writes at a time, any number read; on a server, many learn beside each other. Every change is a version;
    `at` shows the library as it was.
    Recordings are kept in single precision relative to their start: an error of at most 6e-8 of the distance from it.
    """

    def __init__(
        self,
        folder: str | Path | Address,
        *,
        create: bool = False,
        read_only: bool = False,
        recognizer: Recognizer | None = None,
        dmp: DMP | None = None,
        wait: float = 10.0,
    ) -> None:
        specification = Specification.of(recognizer, dmp) if create else None
        kind, location = _store_at(folder)
        self.store = kind(location, specification, read_only=read_only, wait=wait)
        if Specification.of(recognizer, dmp, self.specification) != self.specification:
            self.close()
            raise SpecificationError(
                f"expected the recognizer and dmp that the library in {folder} was made with, got others; its features "
                "would mean something else: leave them out, or make another library"
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        try:
            if error is not None:  # also of functions over the store
                verify.blame(self.store, error)
        finally:
            self.close()

    def close(self) -> None:
        """Close the database; the last process to do so leaves a single file."""
        self.store.close()

    def __len__(self) -> int:
        return self.store.counts.movements

    __iter__ = None  # its length counts movements, its items are symbols: iterate `movements` or `symbols`

    def __repr__(self) -> str:
        dims = "" if self.n_dims is None else f"{self.n_dims} dims, "
        return (
            f"ActionLibrary({str(self.folder)!r}: {len(self)} movements, {dims}{self.store.counts.symbols} symbols, "
            f"version {self.version})"
        )

    def _repr_html_(self) -> str:
        """Show the first 20 symbols in a notebook, each with its prototype or its first movement; names are escaped."""
        named = self.symbols()
        shown = named[:_LISTED]
        ids = [int(symbol.members[0]) if symbol.prototype is None else symbol.prototype for symbol in shown]
        movements = self.movements(ids=ids) if ids else ()
        rows = [(symbol.name, f"{len(symbol):,}", symbol.description) for symbol in shown]
        more = f"The first {_LISTED} of {len(named):,} symbols." if named[_LISTED:] else ""
        pictures = [thumbnail(movement.positions) for movement in movements]
        return to_html(Table(repr(self), ("symbol", "movements", "description"), rows, more, pictures))

    @property
    def folder(self) -> Path | Address:
        """Folder of the library; of one on a server its address, which shows no password."""
        folder: Path | Address = self.store.folder
        return folder

    @property
    def version(self) -> int:
        """Number of the last change, from 0."""
        return self.store.version

    @property
    def n_dims(self) -> int | None:
        """Dimensions that all movements share; None before the first."""
        return self.store.n_dims

    @property
    def channels(self) -> Channels | None:
        """Channels that its movements were recorded as, and those to be recognized should be; None if unknown."""
        return self.store.channels

    @property
    def specification(self) -> Specification:
        """The specification of features and primitives."""
        return self.store.specification

    def learn(
        self,
        movements: MovementsLike,
        labels: Sequence[Any] | None = None,
        source: Source | Sequence[Source | None] | None = None,
        *,
        groups: Sequence[Any] | None = None,
        places: Sequence[Any] | None = None,
        progress: Callable[[int, int], object] | None = None,
    ) -> LearnReport:
        """Store movements that are not there yet.

        Parameters
        ----------
        movements : movements
            Whatever `Demonstrations.of` accepts.
        labels : sequence of n str or None, optional
            Names of symbols, which are created if needed; by default the labels of the movements. None is unlabeled.
        source : Source, or sequence of n Source or None, optional
            The files of the movements.
        groups : sequence of n str, int or None, optional
            Who showed each movement, or what else makes some more alike than new ones will be, as for
            `kineme.Recognizer.fit`: what is unknown is then decided for people who showed nothing. Those of None, whose
            name is not known, count as of one more person. Without groups it is decided for the people who showed.
        places : sequence of n str, optional
            Position of each movement in its file: a movement at a stored position counts as stored already. If not
            given, duplicates are found by their samples alone.
        progress : callable, optional
            Called after every batch with the number of movements done and of all.

        Raises
        ------
        TrajectoryError
            Movements that cannot be used; nothing is stored.
        DataError
            The disk is full, another process writes, ...; batches that were stored stay, and learning the same
            movements again continues after them.

        Notes
        -----
        A movement is stored already if its samples are, in the precision of the library, or its position in a file of
        the same content read with the same options. Such a movement is added to the symbol of its label only if it
        belongs to none, and who showed it is stored only if that was not known.
        """
        from kineme.library.learn import learn

        return learn(self.store, movements, labels, source, places, progress, groups)

    def ids(self, symbol: str | None = None) -> Ids:
        """Return the ids of all movements, or of those of a symbol, ascending."""
        return read.all_ids(self.store) if symbol is None else self[symbol].members

    def unlabeled(self) -> Ids:
        """Return the ids of the movements without a symbol, ascending."""
        return read.unlabeled_ids(self.store)

    def movements(self, symbol: str | None = None, ids: ArrayLike | None = None) -> Demonstrations:
        """Return the recordings: all, those of a symbol (ascending ids), or those of `ids`, in their order.

        Labels are the names of symbols if every movement belongs to one, else None.
        """
        chosen = self._choose(symbol, ids)
        return read.movements(self.store, chosen, read.names_of(self.store, chosen))

    def groups(self, ids: ArrayLike | None = None) -> NDArray[np.object_]:
        """Return who showed each movement, shape (k,): of all, or of `ids`; None where `learn` was not told."""
        return read.groups(self.store, self._choose(None, ids))

    def features(self, ids: ArrayLike | None = None) -> NDArray[np.float32]:
        """Return feature rows, concatenated, shape (k, sum of d * S).

        Those of all representations compared sample by sample and, where others are in detail, positions in detail.
        """
        return read.features(self.store, self._choose(None, ids))

    def primitives(self, symbol: str | None = None, ids: ArrayLike | None = None) -> Primitives:
        """Return the primitives: all, those of a symbol, or those of `ids`, in their order."""
        chosen = self._choose(symbol, ids)
        return read.primitives(self.store, chosen, read.names_of(self.store, chosen))

    def _choose(self, symbol: str | None, ids: ArrayLike | None) -> Ids:
        return self.ids(symbol) if ids is None else read.as_ids(self.store, ids)

    def symbols(self) -> tuple[Symbol, ...]:
        """Return all symbols, by name."""
        return symbols.symbols(self.store)

    def __getitem__(self, who: str) -> Symbol:
        """Return the symbol of that name or, where no symbol has that name, of that id."""
        return symbols.symbol(self.store, who)

    def __contains__(self, who: object) -> bool:
        return symbols.exists(self.store, who)

    @overload
    def recognize(self, movements: Trajectory | NDArray[Any], error_rate: float = ...) -> Answer: ...

    @overload
    def recognize(self, movements: HasDemonstrations | Sequence[Any], error_rate: float = ...) -> list[Answer]: ...

    def recognize(self, movements: MovementsLike, error_rate: float = 0.05) -> Answer | list[Answer]:
        """Recognize movements: the symbol of each, or that it is unknown; labels are names of symbols.

        With up to 1000 movements of symbols, answers are those of `kineme.Recognizer`. With up to 2500 all are
        compared, too, by "auto" with its kernels alone. With more, some hundreds are, which are chosen by bounds from
        the reduced features of all, and p-values are given for the 64 nearest symbols.
        The label is then that of the single nearest movement, as with ``classifier="nearest"``, whichever the library
        was created with. It is the one of comparing all if no representation compares pairs; else nearly always, as the
        bounds say nothing of those, see `kineme.recognition.two_stage_search.TwoStageSearch`. The first answer after a
        change takes longer; distances of many movements are cached beside the database unless `read_only`.

        Parameters
        ----------
        movements : one movement or many
            A `Trajectory` or an array (T, d) is one; else whatever `Demonstrations.of` accepts.
        error_rate : float, default 0.05
            Share of known movements that may be called unknown. It holds for answers that are `calibrated`; with one
            demonstration of each symbol p-values are a guess. See `kineme.recognition.conformal.Calibration`.

        Returns
        -------
        Answer, or list of Answer for many movements
            ``nearest[k].index`` is the id of a movement.

        Raises
        ------
        SpecificationError
            No movement belongs to a symbol, or there is only one movement.
        TrajectoryError
            Movements of another number of dimensions, or of channels of other kinds than those that were learned.
        """
        return self._recognizer.recognize(movements, error_rate)

    def stream(self, confidence: float = 0.9, patience: float = 0.05, early: Early | None = None) -> Live:
        """Recognize a movement while it is under way: `Live`, whose ``update(t, x)`` takes each sample.

        It knows the symbols as they are now; after a change, ask for another one. What streams share is kept, so that
        any number of them may run side by side, each used by one thread at a time.

        Parameters
        ----------
        confidence, patience, early
            As for `kineme.Recognizer.stream`. With more than 2500 movements of symbols, beginnings are those of at most
            ten of each symbol and 1000 in all; ``finish()`` answers as `recognize` does, with ids of movements.

        Raises
        ------
        SpecificationError
            No movement belongs to a symbol, or there is only one movement.
        """
        return self._recognizer.stream(confidence, patience, early)

    def monitor(
        self,
        symbol: str,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        *,
        error_rate: float = 0.05,
        noise: float | None = None,
    ) -> Monitor:
        """Follow an execution of a symbol: `Monitor`, whose ``update(t, x)`` tells whether it is inside what was shown.

        Parameters
        ----------
        symbol : str
            Name or id.
        start, goal : array_like of shape (d,), optional
            Of the execution: it is compared with the demonstrations as their primitives carry them there. By default it
            may begin anywhere. Size and orientation are those that were shown, as far as they varied.
        error_rate : float, default 0.05
            Share of such movements that are called outside, by other people if `learn` was told groups. It takes
            ``1 / error_rate - 1`` demonstrations; with fewer the monitor is not `calibrated`.
        noise : float, optional
            Standard deviation of measured positions, in their unit; by default the jitter of the demonstrations.

        Raises
        ------
        SpecificationError
            No such symbol, or one without movements; an error rate outside 0 to 1, a negative noise.
        TrajectoryError
            A start or goal of the wrong shape.
        """
        from kineme.library.recognize import monitor

        return monitor(self.store, self[symbol].members, (start, goal), error_rate, noise, self.stream)

    @cached_property
    def _recognizer(self) -> LibraryRecognizer:
        from kineme.library.recognize import LibraryRecognizer

        return LibraryRecognizer(self.store)

    def history(self) -> tuple[Version, ...]:
        """Return all versions, the first one first."""
        return history(self.store)

    def undo(self, expected: int | None = None, to: int | None = None) -> Undone:
        """Take back the last change that was not taken back yet, whoever made it, or restore a version, as a new one.

        All that one call of `learn` stored is one change, unless somebody else changed the library meanwhile. Called
        again, it takes back the change before. Symbols get their ids again; a movement that was deleted, or of which
        it was said since who showed it, gets a new id, as if it were learned again. The library keeps the columns and
        the dimensions of its first movements, which can be restored, also where it is empty then.

        Parameters
        ----------
        expected : int, optional
            The version that the library is at, so that no change is taken back that came since it was looked at.
        to : int, optional
            Restore this earlier version instead; 0 is the empty library. Versions between stay in the history, and an
            undo takes the restoring back: to restore the version that was undone is to do its change again.

        Returns
        -------
        Undone
            ``(version, to, action)``: the new version has the state of version `to`; `action` is what was taken back,
            "restore" where `to` was given.

        Raises
        ------
        SpecificationError
            No change is left, there is no such version before the last one or the library is as it was at it, or the
            library is at another version than expected.
        """
        return undo.undo(self.store, expected, to)

    def at(self, version: int) -> ActionLibrary:
        """Open the library as it was at a version, for reading."""
        past = object.__new__(ActionLibrary)
        past.store = type(self.store)(self.store.path, read_only=True, as_of=version, wait=self.store.wait)
        return past

    def verify(self) -> list[Problem]:
        """Find damage: a list of problems with table, row or movement, and a text; empty if nothing is damaged."""
        return verify.verify(self.store)

    def export(self, path: str | Path) -> Path:
        """Write the library, with all its versions, to one new file. Equal libraries give equal bytes."""
        return export_import.export(self.store, path)

    @classmethod
    def import_(cls, path: str | Path, folder: str | Path | Address, **options: Any) -> Self:
        """Create a library in `folder` from a file of `export`, after checking every byte of it, and open it.

        So a library moves from a folder to a server, and back: `export` there, and import here.
        """
        export_import.import_(path, folder)
        return cls(folder, **options)

    def rename(self, old: str, new: str) -> None:
        """Give a symbol another name; its id stays."""
        changes.rename(self.store, old, new)

    def annotate(self, who: str, text: str | None = None, **values: Any) -> None:
        """Set the description of a symbol, its ``prototype`` (id of a member) or ``threshold``; None clears these."""
        changes.annotate(self.store, who, **({} if text is None else {"description": text}), **values)

    def delete(self, what: str | ArrayLike) -> None:
        """Delete a symbol, given by name or id, whose movements stay; or movements, given by their ids.

        Earlier versions still contain them, see `at`.
        """
        if isinstance(what, str):
            changes.delete_symbol(self.store, what)
        else:
            changes.delete_movements(self.store, what)

    def merge(self, names: Sequence[str], into: str) -> None:
        """Merge several symbols into an existing one, or into a new one of that name. Their ids become its parents."""
        changes.merge(self.store, names, into)

    def split(self, name: str, ids: ArrayLike, new: str) -> None:
        """Split a symbol: some of its members become a new symbol, and the old one becomes its parent."""
        changes.split(self.store, name, ids, new)

    def assign(self, ids: ArrayLike, symbol: str, how: str = "anchored") -> None:
        """Assign movements to a symbol, which is created if needed; they leave the one that they belonged to.

        `how` is "label" (by a person), "anchored" (by a cluster) or "recognized".
        """
        changes.assign(self.store, ids, symbol, how)

    def release(self, ids: ArrayLike) -> None:
        """Remove movements from their symbols."""
        changes.release(self.store, ids)

    def join(self, error_rate: float = 0.05) -> dict[str, int]:
        """Add movements without a symbol to those that they are recognized as; return name -> number of new members.

        It expects people who showed some. So it finds more of them unknown than `recognize` does, and leaves these.
        """
        from kineme.library.proposals import assign_recognized, recognized

        return assign_recognized(self.store, recognized(self.store, error_rate))

    def propose(
        self,
        ids: ArrayLike | None = None,
        method: str | None = None,
        n_clusters: int | None = None,
        min_members: int = 3,
    ) -> LibraryProposals:
        """Propose symbols for the movements without one, or for `ids`; a person names them.

        If there are symbols, their members define how similar movements of one symbol are, see
        `kineme.anchoring.assign`. If there are none, or if `method` or `n_clusters` is given, the movements are
        clustered, see `kineme.anchoring.propose`, with the people who were named when they were learned as groups. A
        proposal is left out if four fifths of its movements were in one rejected proposal. Fewer than three movements
        make no proposal.
        """
        from kineme.library.proposals import propose

        return propose(self.store, ids, method, n_clusters, min_members)

    def accept(self, proposal: Proposal, name: str, description: str | None = None) -> None:
        """Assign the members of a proposal to a symbol, which is created if needed, with the medoid as its prototype.

        Members that were assigned to other symbols since the proposal was made stay there.
        """
        from kineme.library.proposals import accept

        accept(self.store, proposal, name, description)

    def reject(self, proposal: Proposal) -> None:
        """Reject a proposal: its movements stay without a symbol and are not proposed again, until that is undone."""
        from kineme.library.proposals import reject

        reject(self.store, proposal)

    def ground(self, who: str, by: str = "medoid", units: str | Sequence[str] | None = None) -> dict[str, Any]:
        """Describe a symbol for a planner: its prototype as a primitive and the ranges of its parameters.

        Plain data, as `kineme.anchoring.grounding.grounding_schema` describes it;
        `kineme.anchoring.grounding.primitive_from` makes it move again.

        Parameters
        ----------
        who : str
            Name or id of a symbol.
        by : {"medoid", "mean"}, default "medoid"
            The prototype: the one that was set or else the medoid, or the mean of the members aligned with that one.
        units : str or sequence of d str, optional
            Units of the positions, as "mm", or one of each dimension, by default those of the recordings, if all are
            known. Refused if a recording says another one: a unit converts no numbers.
        """
        from kineme.library.grounding import ground_symbol

        return ground_symbol(self.store, who, by, units)

    def nearest(self, who: str, k: int = 3) -> tuple[Near, ...]:
        """Find the symbols nearest to one, nearest first; see `kineme.anchoring.space.ConceptualSpace`."""
        from kineme.library.grounding import space_of

        return space_of(self.store).nearest(self[who].name, k)

    def between(self, a: str, b: str, eps: float = 0.25) -> tuple[Between, ...]:
        """Find the symbols that lie between two, the smallest detour first."""
        from kineme.library.grounding import space_of

        return space_of(self.store).between(self[a].name, self[b].name, eps)

    def morph(self, a: str, b: str, shares: ArrayLike = 0.5) -> Primitives:
        """Return primitives between two symbols, one for each share of the way: 0 is a, 1 is b."""
        from kineme.anchoring.space import morph
        from kineme.library.grounding import primitive_of

        return morph(primitive_of(self.store, a), primitive_of(self.store, b), shares, self.specification.comparison)

    def review(self) -> Review:
        """Find symbols whose movements are hard to tell apart, and symbols whose movements form two clusters.

        The result suggests calls of `merge` and `split`; nothing is changed.
        """
        from kineme.library.proposals import review

        return review(self.store)
