"""Every kind of primitives goes to a file, and comes back bit for bit, through one table."""

import json

import numpy as np
import pytest

import kineme
from kineme.dmp.rhythmic.rhythmic_dmp import RhythmicPrimitives
from kineme.orientation import PoseDMP, PosePrimitives, exp

LABELS, NAMES = ["a", "b", "a"], ["one", None, "三"]


def reaches(**specification):
    rng = np.random.default_rng(3)
    arrays = [np.cumsum(rng.normal(size=(m, 2)), axis=0) for m in (30, 41, 52)]
    return kineme.DMP(**specification).learn(kineme.Demonstrations.from_arrays(arrays, LABELS, names=NAMES))


def waves(**specification):
    t = np.linspace(0.0, 3.0, 300)
    arrays = [
        np.column_stack((np.sin(2 * np.pi * f * t), a * np.cos(2 * np.pi * f * t) ** 3))
        for f, a in ((1, 2), (1.2, 1), (2, 3))
    ]
    times = [t] * 3
    return kineme.RhythmicDMP(**specification).learn(kineme.Demonstrations.from_arrays(arrays, LABELS, times, NAMES))


def poses(**specification):
    rng, u = np.random.default_rng(4), np.linspace(0.0, 1.0, 60)[:, None]
    turns = [exp(u**2 * rng.normal(size=3)) for _ in range(3)]
    arrays = [np.hstack((np.sin(u * rng.normal(size=3)), q)) for q in turns]
    return PoseDMP(kineme.DMP(**specification)).learn(kineme.Demonstrations.from_arrays(arrays, LABELS, names=NAMES))


KINDS = {"primitives": reaches, "rhythmic primitives": waves, "pose primitives": poses}
every_kind = pytest.mark.parametrize("kind", KINDS)


def numbers(primitives):
    """Everything that a batch holds, by name."""
    if isinstance(primitives, PosePrimitives):
        return {"references": primitives.references} | numbers(primitives.tangent)
    return {name: getattr(primitives, name) for name in primitives.ROWS}


def specification(primitives):
    return primitives.tangent.dmp if isinstance(primitives, PosePrimitives) else primitives.dmp


def assert_same(after, before):
    assert specification(after) == specification(before)
    assert numbers(after).keys() == numbers(before).keys()
    for name, values in numbers(before).items():
        np.testing.assert_array_equal(numbers(after)[name], values, err_msg=name)
        assert not numbers(after)[name].flags.writeable
    assert list(after.labels) == list(before.labels)
    assert after.names == before.names


@every_kind
@pytest.mark.parametrize("fit", ["forcing", "trajectory"])
def test_round_trip_is_exact(tmp_path, kind, fit):
    before = KINDS[kind](fit=fit, n_basis=12, damping=17.5, ridge=1e-5)
    after = type(before).load(before.save(tmp_path / "x.kineme"))
    assert_same(after, before)
    for name in ("velocities", "accelerations"):
        np.testing.assert_array_equal(getattr(after.rollout(), name), getattr(before.rollout(), name))


def test_preprocessing_of_a_rhythmic_specification_comes_back(tmp_path):
    before = waves(preprocessing=(kineme.Smooth(30.0),), align_on=1)
    after = RhythmicPrimitives.load(before.save(tmp_path / "x"))
    assert after.dmp.preprocessing == (kineme.Smooth(30.0),)


@every_kind
@pytest.mark.parametrize("other", KINDS)
def test_a_file_of_another_kind_is_refused(tmp_path, kind, other):
    path = KINDS[other]().save(tmp_path / "x")
    cls = type(KINDS[kind]())
    if kind == other:
        assert len(cls.load(path)) == 3
        return
    with pytest.raises(kineme.errors.DataError, match=rf"x to hold {kind}, got '{other}'"):
        cls.load(path)


@every_kind
@pytest.mark.parametrize("kept", [0.1, 0.9])
def test_a_truncated_file_is_refused(tmp_path, kind, kept):
    primitives = KINDS[kind]()
    path = primitives.save(tmp_path / "x")
    path.write_bytes(path.read_bytes()[: int(kept * path.stat().st_size)])
    with pytest.raises(kineme.errors.DataError, match="truncated"):
        type(primitives).load(path)


def _rewrite(path, **changes):
    """Replace arrays of a saved file, or drop those that are None, or change the specification or the header."""
    with np.load(path) as archive:
        arrays = dict(archive)
    header = json.loads(arrays.pop("header").tobytes())
    header["dmp"] |= changes.pop("dmp", {})
    header |= changes.pop("header", {})
    arrays = {name: value for name, value in (arrays | changes).items() if value is not None}
    with path.open("wb") as file:
        np.savez(file, header=np.frombuffer(json.dumps(header).encode(), dtype=np.uint8), **arrays)


@pytest.mark.parametrize(
    ("kind", "change", "words"),
    [
        ("rhythmic primitives", {"periods": np.ones(2)}, r"periods should be finite .* of shape \(3,\)"),
        ("rhythmic primitives", {"phases": None}, "phases"),
        ("rhythmic primitives", {"baselines": np.full((3, 2), np.nan)}, "baselines should be finite"),
        ("rhythmic primitives", {"scaled_weights": np.ones(3)}, "KeyError"),
        ("rhythmic primitives", {"dmp": {"formulation": "original"}}, "formulation"),
        ("primitives", {"header": {"names": ["one", "two"]}}, "names should be a list of 3 texts"),
        ("primitives", {"header": {"names": "one"}}, "names should be a list of 3 texts"),
        ("primitives", {"header": {"names": ["one", "two", 3]}}, "names should be a list of 3 texts"),
        ("primitives", {"header": {"labels": ["a", "b"]}}, "labels should be a list of 3 texts or numbers"),
        ("primitives", {"header": {"labels": ["a", "b", ["c"]]}}, "labels should be a list of 3 texts or numbers"),
        ("pose primitives", {"references": None}, "references"),
        ("pose primitives", {"references": np.ones((2, 4))}, r"references should be finite .* of shape \(3, 4\)"),
        ("pose primitives", {"references": np.ones((3, 4))}, "unit quaternion"),
    ],
)
def test_contents_that_do_not_fit_are_refused(tmp_path, kind, change, words):
    primitives = KINDS[kind]()
    path = primitives.save(tmp_path / "x")
    _rewrite(path, **change)
    with pytest.raises(kineme.errors.DataError, match=rf"x to hold complete {kind}, got .*{words}"):
        type(primitives).load(path)


def test_poses_need_three_or_six_dimensions(tmp_path):
    path = poses(n_basis=12).save(tmp_path / "x")
    flat = {name: np.zeros((3, 2)) for name in ("starts", "goals", "velocities", "extents")}
    _rewrite(path, scaled_weights=np.zeros((3, 2, 12)), **flat)
    with pytest.raises(kineme.errors.DataError, match="3 or 6 dimensions, have 2"):
        PosePrimitives.load(path)


@every_kind
def test_concatenation_undoes_a_split(kind):
    whole = KINDS[kind]()
    assert_same(type(whole).concatenate([whole[:1], whole[1:]]), whole)
    assert len(type(whole).concatenate([whole, whole])) == 6


@every_kind
def test_batches_of_different_specifications_do_not_mix(kind):
    a, b = KINDS[kind](n_basis=12), KINDS[kind](n_basis=13)
    with pytest.raises(
        kineme.errors.SpecificationError, match=r"batch 1: expected n_basis=12 as in batch 0, got 13; .*again"
    ):
        type(a).concatenate([a, b])


@every_kind
def test_only_batches_of_the_same_kind_can_be_concatenated(kind):
    a = KINDS[kind]()
    with pytest.raises(kineme.errors.TrajectoryError, match=rf"{type(a).__name__}, got str"):
        type(a).concatenate([a, "b"])
    with pytest.raises(kineme.errors.TrajectoryError, match="got none"):
        type(a).concatenate([])


def test_labels_and_dimensions_must_agree_to_be_concatenated():
    a = kineme.DMP().learn(kineme.Demonstrations.from_arrays(np.arange(40.0).reshape(1, 20, 2) ** 2, ["a"]))
    b = kineme.DMP().learn(np.arange(40.0).reshape(1, 20, 2) ** 2)
    with pytest.raises(kineme.errors.TrajectoryError, match="labels on every batch or on none, got them on 1 of 2"):
        kineme.dmp.Primitives.concatenate([a, b])
    with pytest.raises(kineme.errors.TrajectoryError, match="batch 1: expected 2 dimensions as in batch 0, got 1"):
        kineme.dmp.Primitives.concatenate([b, kineme.DMP().learn([np.arange(20.0) ** 2])])


def test_labels_must_be_of_one_type_to_be_concatenated():
    a, b = (
        kineme.DMP().learn(kineme.Demonstrations.from_arrays(np.arange(40.0).reshape(1, 20, 2) ** 2, [label]))
        for label in ("a", 1)
    )
    with pytest.raises(kineme.errors.TrajectoryError, match="labels of one type, got texts, int64"):
        kineme.dmp.Primitives.concatenate([a, b])
    assert len(kineme.dmp.Primitives.concatenate(one for one in (a, a))) == 2


@every_kind
def test_a_batch_shows_itself_in_one_line(kind):
    shown = repr(KINDS[kind]())
    assert shown.startswith(type(KINDS[kind]()).__name__ + "(3 movements")
    assert "\n" not in shown
    assert len(shown) < 400


@every_kind
def test_a_primitive_is_a_batch_of_one(kind):
    whole = KINDS[kind]()
    assert [len(one) for one in whole] == [1, 1, 1]
    assert_same(type(whole).concatenate(whole), whole)
    assert_same(type(whole).concatenate([whole[0], whole[1], whole[-1]]), whole)
    with pytest.raises(IndexError):
        whole[3]
