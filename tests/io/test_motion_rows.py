"""Rows that say what holds when: one at most for a frame, and never closer than LeRobot can tell apart."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from kineme.io.lerobot.motions import (
    DETAILS,
    Motion,
    Row,
    own_rows,
    read_motions,
    rows_of,
    write_details,
)

STAMPS = (np.arange(100) / 10).astype(np.float32).astype(np.float64)

times = st.floats(-1, 12)
spans = st.builds(lambda start, length: (start, start + length), times, st.floats(0, 4))
motions = st.lists(
    st.builds(lambda span, symbol: Motion(0, *span, symbol), spans, st.sampled_from(["reach", "grasp", None])),
    max_size=8,
)


def active(rows, stamp):
    """The content that LeRobot finds at a frame: of the last row until then."""
    before = [row for row in rows if row.stamp <= stamp]
    return before[-1].content if before else None


def test_ends_and_rests_have_rows():
    rows = rows_of(STAMPS, [Motion(0, 4.02, 5.0, None), Motion(0, 1.04, 2.96, "reach"), Motion(0, 5.1, 9.9, "reach")])
    expected = {0.0: "rest", 1.0: "reach", 3.1: "rest", 4.0: "unknown", 5.1: "reach"}
    assert [(round(row.stamp, 4), row.content) for row in rows] == list(expected.items())
    assert [row.motion is None for row in rows] == [True, False, True, False, False]


def test_what_is_too_short_for_a_row_leaves_the_one_before():
    rows = rows_of(STAMPS, [Motion(0, 1, 2, "reach"), Motion(0, 2.2, 3, "grasp"), Motion(0, 3.1, 3.2, "tap")])
    assert [row.content for row in rows] == ["rest", "reach", "grasp", "rest"]
    assert rows_of(STAMPS, [Motion(0, 9.8, 9.9, "tap")]) == [Row(0.0, "rest")]


def test_of_two_that_overlap_the_later_one_holds_and_then_the_first_one_again():
    rows = rows_of(STAMPS, [Motion(0, 0, 9, "carry"), Motion(0, 3, 4, "tilt")])
    assert [(round(row.stamp, 4), row.content) for row in rows] == [
        (0, "carry"),
        (3, "tilt"),
        (4.1, "carry"),
        (9.1, "rest"),
    ]
    assert rows[2].motion is None  # it begins but once


def test_an_episode_without_motions_or_frames_has_no_rows():
    assert rows_of(STAMPS, []) == []
    assert rows_of(np.empty(0), [Motion(0, 0, 1, "reach")]) == []
    assert rows_of(np.full(3, np.nan), [Motion(0, 0, 1, "reach")]) == []


@given(motions, st.sets(st.sampled_from(STAMPS.tolist())))
def test_rows_stand_on_frames_one_at_most_and_apart(motions, taken):
    rows = rows_of(STAMPS, motions, taken)
    stamps = [row.stamp for row in rows]
    assert {*stamps} <= {*STAMPS.tolist()} - taken
    assert all(np.diff(stamps) > 0.2)
    assert {row.content for row in rows} <= {"rest", "unknown", "reach", "grasp"}
    begun = [id(row.motion) for row in rows if row.motion is not None]
    assert len(begun) == len({*begun})


@given(st.lists(st.tuples(st.sampled_from(["reach", "grasp", "rest"]), st.integers(3, 9)), min_size=1, max_size=12))
def test_each_frame_is_told_what_holds_there(stretches):
    """Stretches of three frames or more, one after the other, are found again at each frame."""
    ends = np.cumsum([length for _, length in stretches])
    stamps = np.arange(ends[-1] + 1) / 10
    motions = [
        Motion(0, (end - length) / 10, (end - 1) / 10, name)
        for (name, length), end in zip(stretches, ends.tolist(), strict=True)
        if name != "rest"
    ]
    rows = rows_of(stamps, motions)
    truth = np.repeat([name for name, _ in stretches], [length for _, length in stretches])
    if motions:
        assert [active(rows, np.float32(stamp)) for stamp in stamps[: ends[-1]]] == truth.tolist()


@given(motions)
def test_stamps_in_any_order_do_no_harm(motions):
    rng = np.random.default_rng(0)
    stamps = rng.permutation(np.concatenate((STAMPS[:20], STAMPS[:5], [np.nan])))
    found = [row.stamp for row in rows_of(stamps, motions)]
    assert len(found) == len({*found})


def test_details_are_a_table_of_any_length(tmp_path, monkeypatch):
    monkeypatch.setattr("kineme.io.lerobot.motions._AT_ONCE", 3)
    motions = [Motion(k // 4, k % 4, k % 4 + 0.5, None if k % 3 else "wave", 0.1 * k) for k in range(11)]
    rows = [Row(motion.start, "x", motion) for motion in motions]
    details = [(row.motion.episode, [row.motion], [row]) for row in rows]
    write_details(tmp_path / DETAILS, [*details, (7, [], [Row(0.5, "rest")])])
    read = read_motions(tmp_path)
    assert [motion[:5] for motion in read] == [motion[:5] for motion in motions]
    assert all(math.isnan(motion.confidence) for motion in read)
    assert len(own_rows(tmp_path).keys) == 12
    write_details(tmp_path / DETAILS, [])
    assert read_motions(tmp_path) == []
