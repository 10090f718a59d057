"""Changes taken back: the state before, as a new version."""

from __future__ import annotations

import numpy as np
import pytest
from library_samples import draw_movements

from kineme import ActionLibrary, Demonstrations, load_lasa
from kineme.errors import SpecificationError, TrajectoryError
from kineme.library import learn as learning
from kineme.library.proposals import NamedProposal, store_proposals, stored_proposals
from kineme.library.storage.undo import can_undo


@pytest.fixture
def library(place):
    demos = draw_movements(12, 2, 3)
    labels = [["wave", "push", None][i % 3] for i in range(12)]
    with ActionLibrary(place, create=True) as library:
        library.learn(demos, labels, groups=["Ann"] * 6 + [None] * 6)
        yield library


def _state(library):
    """What a user sees, movements by their samples: names, descriptions, members, prototypes, people."""
    ids = library.ids()
    if not len(ids):
        return {}
    first = {
        int(i): tuple(movement.positions[:3].ravel().round(6))
        for i, movement in zip(ids, library.movements(), strict=True)
    }
    symbols = {
        symbol.id: (
            symbol.name,
            symbol.description,
            sorted(first[i] for i in symbol.members.tolist()),
            first.get(symbol.prototype),
        )
        for symbol in library.symbols()
    }
    people = sorted(zip(first.values(), library.groups().astype(str), strict=True))
    rows = {first[int(i)]: row for i, row in zip(ids, library.features(), strict=True)}
    return {"symbols": symbols, "people": people, "rows": [rows[key].tobytes() for key in sorted(rows)]}


CHANGES = {
    "rename": lambda library: library.rename("wave", "hello"),
    "annotate": lambda library: library.annotate("wave", "a greeting", prototype=1),
    "delete a symbol": lambda library: library.delete("wave"),
    "delete movements": lambda library: library.delete([1, 2, 3]),
    "delete all": lambda library: library.delete(library.ids()),
    "merge": lambda library: library.merge(["wave", "push"], "both"),
    "merge into one": lambda library: library.merge(["wave"], "push"),
    "split": lambda library: library.split("wave", [1, 4], "half"),
    "assign": lambda library: library.assign([1, 2, 3], "push"),
    "assign to a new one": lambda library: library.assign([1, 2, 3], "new"),
    "release": lambda library: library.release([1, 2]),
    "learn": lambda library: library.learn(draw_movements(3, 2, 9), ["wave", "other", None]),
    "say who showed": lambda library: library.learn(draw_movements(12, 2, 3), groups=["Bob"] * 12),
}


@pytest.mark.parametrize("change", CHANGES)
def test_an_undo_brings_back_what_was(library, change):
    library.annotate("wave", "of a hand", prototype=4)
    before, version = _state(library), library.version
    CHANGES[change](library)
    assert _state(library) != before
    undone = library.undo()
    assert undone == (library.version, version, library.at(version + 1).history()[-1].action)
    assert _state(library) == before
    assert library.verify() == []


def test_all_changes_are_taken_back_one_by_one_and_new_ones_after_an_undo_too(library):
    states = [_state(library)]
    for name in ("annotate", "delete movements", "merge", "learn"):
        CHANGES[name](library)
        states.append(_state(library))
    library.undo()
    library.undo()
    assert _state(library) == states[2]
    library.rename("push", "shove")
    library.undo()
    for state in (states[1], states[0], {}):
        library.undo()
        assert _state(library) == state
    assert not can_undo(library.store)
    version = library.version
    with pytest.raises(SpecificationError, match="expected a change to take back, the library has none left"):
        library.undo()
    assert library.version == version
    assert library.verify() == []


def test_all_batches_of_one_call_are_one_change(library, monkeypatch):
    monkeypatch.setattr(learning, "_BATCH_MOVEMENTS", 4)
    before, version = _state(library), library.version
    library.learn(draw_movements(10, 2, 9), ["wave", "other"] * 5)
    assert library.version == version + 3
    library.learn(draw_movements(10, 2, 17), ["later"] * 10)  # another call: not taken back with it
    assert library.undo() == (version + 7, version + 3, "learn")
    assert library.undo() == (version + 8, version, "learn")
    assert _state(library) == before
    assert library.verify() == []


def test_what_others_change_between_two_batches_ends_what_one_undo_takes_back(library, monkeypatch):
    monkeypatch.setattr(learning, "_BATCH_MOVEMENTS", 4)
    version, commit = library.version, learning.commit.commit

    def after_another(store, batch, continues):
        if continues is not None:
            with ActionLibrary(library.folder) as other:
                other.rename("push", "shove")
        return commit(store, batch, continues)

    monkeypatch.setattr(learning.commit, "commit", after_another)
    library.learn(draw_movements(8, 2, 9), ["wave", "other"] * 4)
    assert [change.action for change in library.history()[version:]] == ["learn", "rename", "learn"]
    assert library.undo() == (version + 4, version + 2, "learn")


def test_what_others_change_between_two_batches_is_a_change_of_its_own(library, monkeypatch):
    monkeypatch.setattr(learning, "_BATCH_MOVEMENTS", 4)
    before, version = _state(library), library.version

    def other(done, total):
        if done == 4:
            with ActionLibrary(library.folder) as other:
                other.rename("push", "shove")

    library.learn(draw_movements(8, 2, 9), ["wave", "other"] * 4, progress=other)
    assert sorted(change.action for change in library.history()[version:]) == ["learn", "learn", "rename"]
    while library.undo().to > version:
        pass
    assert _state(library) == before
    assert not {"shove"} & {symbol.name for symbol in library.symbols()}


def test_an_undo_of_another_version_than_the_one_looked_at_is_refused(library):
    seen = library.version
    library.rename("wave", "hello")
    with pytest.raises(SpecificationError, match=f"take back version {seen}, the library is at version {seen + 1}"):
        library.undo(seen)
    assert "hello" in library


def test_recognition_follows(library):
    question = library.movements()[0]
    library.delete("wave")
    assert library.recognize(question).ranked == ("push",)
    library.undo()
    assert library.recognize(question).label == "wave"


def test_places_in_files_are_free_for_movements_that_return(library, tmp_path):
    from kineme.library.storage.source import Source

    source = Source("a.csv", "0" * 64, 10, "table")
    first, second = draw_movements(2, 2, 21)
    ids = library.learn(Demonstrations([first]), ["wave"], source, places=["0"]).ids
    library.delete(ids)
    before = _state(library.at(library.version - 1))
    library.learn(Demonstrations([second]), ["wave"], source, places=["0"])
    library.undo()
    library.undo()
    assert _state(library) == before
    assert library.verify() == []


def test_a_proposal_that_was_accepted_is_one_change(library):
    version = library.version
    library.release(library.ids())
    proposal = library.propose(n_clusters=2, min_members=2)[0]
    with pytest.raises(SpecificationError, match="expected a description, got 3"):
        library.accept(proposal, "new", 3)
    library.accept(proposal, "new", "down and up")
    assert (library["new"].prototype, library["new"].description) == (proposal.medoid, "down and up")
    assert library.history()[-1].detail["description"] == "down and up"
    library.undo()
    assert len(library.symbols()) == 2
    assert not np.concatenate([symbol.members for symbol in library.symbols()]).size
    library.undo()
    assert _state(library) == _state(library.at(version))


def test_who_showed_movements_is_corrected_by_saying_it_again_after_an_undo(library):
    CHANGES["say who showed"](library)
    library.undo()
    library.learn(draw_movements(12, 2, 3), groups=["Cleo"] * 12)
    assert library.groups().tolist().count("Cleo") == 6
    assert len(library) == 12
    assert library.verify() == []


def test_an_empty_library_says_why_it_keeps_its_dimensions(library):
    library.undo(to=0)
    with pytest.raises(TrajectoryError, match=r"2 dimensions as those of earlier versions, .*, or make another"):
        library.learn(draw_movements(2, 3))
    assert library.learn(draw_movements(2)).added == 2


def test_the_past_and_libraries_open_for_reading_undo_nothing(library):
    past = library.at(library.version)
    assert not can_undo(past.store)
    past.close()


def test_every_version_is_restored_and_an_undo_takes_that_back(library):
    states = [{}, _state(library)]
    for name in ("annotate", "say who showed", "merge", "delete movements", "learn"):
        CHANGES[name](library)
        states.append(_state(library))
    for to in (2, 3, 4, 0, 5):
        last = library.version
        assert library.undo(last, to=to) == (last + 1, to, "restore")
        assert _state(library) == states[to]
        library.undo()
        assert _state(library) == states[6]
    assert library.verify() == []


def test_what_was_undone_is_done_again_by_restoring_it(library):
    version, before = library.version, _state(library)
    library.rename("wave", "hello")
    library.undo()
    assert library.undo(to=version + 1) == (version + 3, version + 1, "restore")
    assert "hello" in library
    library.undo()  # takes back the restoring: the change stays undone
    assert _state(library) == before
    library.undo()
    assert _state(library) == {}


def test_a_version_that_cannot_be_restored_is_refused(library):
    seen = library.version
    library.rename("wave", "hello")
    with pytest.raises(
        SpecificationError, match=f"replace version {seen}, the library is at version {seen + 1} by now"
    ):
        library.undo(seen, to=0)
    for to in (seen + 1, -1, True, 1.0, "1"):
        with pytest.raises(SpecificationError, match=f"expected a version before {seen + 1} to restore"):
            library.undo(to=to)
    library.undo()
    with pytest.raises(SpecificationError, match=f"the library is as at version {seen}; nothing was changed"):
        library.undo(to=seen)
    assert library.version == seen + 2


def _sizes(library):
    return [len(proposal) for proposal in library.propose()]


def test_what_is_rejected_is_proposed_again_while_that_is_undone(place):
    with ActionLibrary(place, create=True) as library:
        library.learn([movement.positions for movement in load_lasa(["Angle", "Sine", "Worm"])])
        assert _sizes(library) == [7, 7, 7]
        library.reject(library.propose()[0])
        assert _sizes(library) == [7, 7]
        library.undo()
        assert _sizes(library) == [7, 7, 7]
        library.undo(to=2)
        assert _sizes(library) == [7, 7]
        library.undo()
        assert _sizes(library) == [7, 7, 7]
        library.reject(library.propose()[0])
        library.reject(library.propose()[0])
        library.undo()  # the second one alone
        assert _sizes(library) == [7, 7]
        for version, sizes in enumerate([[7] * 3, [7] * 2, [7] * 3, [7] * 2, [7] * 3, [7] * 2, [7], [7] * 2], start=1):
            with library.at(version) as past:
                assert _sizes(past) == sizes


def test_deleted_movements_that_return_are_rejected_and_proposed_as_before(place):
    def shown(library):
        names = dict(zip(library.ids(), library.movements().names, strict=True))
        return [(each.name, names[each.medoid], {names[i] for i in each.members}) for each in library.propose()]

    demos = load_lasa(["Angle", "Sine", "Worm"])
    with ActionLibrary(place, create=True) as library:
        ids = library.learn(demos, [None] * len(demos)).ids
        store_proposals(
            library.store, [NamedProposal(f"kind {k}", ids[7 * k : 7 * k + 7], 7 * k + 4, 0.9) for k in range(3)]
        )
        library.reject(library.propose()[2])
        before, version = shown(library), library.version
        assert [each[:2] for each in before] == [("kind 0", "Angle 4"), ("kind 1", "Sine 4")]
        for deleted in (demos.names[:1], demos.names[3:12], demos.names[14:], demos.names):
            names = library.movements().names
            library.delete([i for i, name in zip(library.ids(), names, strict=True) if name in deleted])
            library.undo()
            assert shown(library) == before
        library.undo(to=0)
        assert stored_proposals(library.store) == []
        library.undo(to=version)
        assert shown(library) == before
        with library.at(version) as past:
            assert shown(past) == before
        library.delete(library.ids())
        library.learn(demos, [None] * len(demos))  # they return in this way, too
        assert shown(library) == before
        assert library.verify() == []
