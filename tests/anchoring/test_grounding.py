"""What a symbol is grounded in fits the published schema, moves again, and refuses what is no grounding."""

from __future__ import annotations

import json
from dataclasses import fields

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kineme
from kineme.anchoring.grounding import SymbolName, ground, grounding_schema, medoid_of, primitive_from
from kineme.dmp.discrete.specification import FORMULATIONS
from soaking import examples
from unlabeled_samples import draw_kinds

quick = settings(max_examples=examples(3, 8), deadline=None, derandomize=True)
WAVE = SymbolName("sym-1", "wave", "a hand says hello", ("sym-0",))
VALIDATOR = jsonschema.Draft202012Validator(grounding_schema())


def _learn(n=4, d=2, seed=0, spread=0.1, **specification):
    return kineme.DMP(n_basis=20, **specification).learn(draw_kinds([n], d, seed, spread))


def _read_back(grounding):
    return json.loads(json.dumps(grounding, allow_nan=False))


def test_the_schema_is_one():
    jsonschema.Draft202012Validator.check_schema(grounding_schema())
    assert grounding_schema()["$schema"].endswith("draft/2020-12/schema")


def test_the_schema_knows_every_choice_of_a_specification():
    listed = grounding_schema()["properties"]["dmp"]["properties"]
    assert set(listed) == {field.name for field in fields(kineme.DMP)}
    assert set(listed["formulation"]["enum"]) == set(FORMULATIONS)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("by", ["medoid", "mean"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
@given(seed=st.integers(0, 10_000), n=st.sampled_from([1, 2, 3, 6]), d=st.sampled_from([1, 2, 3, 4]))
@quick
def test_a_grounding_fits_the_schema_and_moves_again(by, formulation, seed, n, d):
    primitives = _learn(n, d, seed, formulation=formulation)
    grounding = ground(WAVE, primitives, by=by, units="m")
    VALIDATOR.validate(_read_back(grounding))
    again = primitive_from(_read_back(grounding))
    for name in again.ROWS:
        np.testing.assert_array_equal(getattr(again, name), getattr(primitive_from(grounding), name))
    assert again.labels.tolist() == ["wave"]
    if by == "medoid":
        shown = primitives[grounding["prototype"]["medoid"]]
        goal = shown.goals[0] + 0.5
        ours, theirs = (one.rollout(goal=goal, duration=2.0) for one in (again, shown))
        np.testing.assert_array_equal(ours.positions, theirs.positions)
        np.testing.assert_array_equal(ours.times, theirs.times)


def test_the_demonstrated_ranges():
    primitives = _learn(5, 3)
    grounding = ground(WAVE, primitives)
    values = {
        "start": primitives.starts,
        "goal": primitives.goals,
        "displacement": primitives.goals - primitives.starts,
        "extent": primitives.extents,
        "duration": primitives.durations,
    }
    for name, shown in values.items():
        for what, percent in (("min", 0), ("median", 50), ("max", 100)):
            np.testing.assert_allclose(grounding["demonstrated"][name][what], np.percentile(shown, percent, axis=0))
    assert grounding["symbol"] == {
        "id": "sym-1",
        "name": "wave",
        "description": "a hand says hello",
        "parents": ["sym-0"],
    }
    assert (grounding["n_dims"], grounding["n_demonstrations"]) == (3, 5)


@given(seed=st.integers(0, 10_000))
@quick
def test_styles_move_as_the_demonstrations_did(seed):
    """All styles kept, a demonstration's coordinates give its own path, laid onto the medoid."""
    primitives = _learn(6, 2, seed, spread=0.3)
    grounding = _read_back(ground(WAVE, primitives))
    styles = grounding["styles"]
    shown = primitive_from(grounding, styles["coordinates"]).rollout().positions
    mean = primitive_from(grounding, np.zeros(len(styles["min"]))).rollout().positions
    assert shown.shape == (6, 200, 2)
    np.testing.assert_allclose(shown.mean(axis=0), mean[0], atol=1e-8)
    assert 0.95 <= sum(styles["explained_variance"]) <= 1.0 + 1e-12
    by_mean = primitive_from(ground(WAVE, primitives, by="mean"))
    np.testing.assert_allclose(by_mean.rollout().positions, mean, atol=1e-8)


def test_styles_are_found_again_from_their_movements():
    from kineme.anchoring.grounding import style_model

    grounding = ground(WAVE, _learn(6, 2, 1, spread=0.3))
    model = style_model(grounding["styles"], primitive_from(grounding).dmp)
    found = model.style_of(model.primitive(grounding["styles"]["coordinates"]))
    np.testing.assert_allclose(found.styles, grounding["styles"]["coordinates"], atol=1e-6)


def test_too_few_or_equal_demonstrations_have_no_style():
    primitives = _learn(2)
    assert ground(WAVE, primitives)["styles"] is None
    assert ground(WAVE, primitives[[0, 0, 0, 0]])["styles"] is None
    with pytest.raises(
        kineme.errors.SpecificationError, match=r"expected no style, since the 2 demonstrations of 'wave'.*got \[0.0\]"
    ):
        primitive_from(ground(WAVE, primitives), [0.0])


def test_units_of_each_dimension():
    primitives = _learn(3)
    assert ground(WAVE, primitives)["units"] == {"position": None, "time": "s"}
    assert ground(WAVE, primitives, units="mm")["units"]["position"] == ["mm", "mm"]
    assert ground(WAVE, primitives, units=["m", "rad"])["units"]["position"] == ["m", "rad"]
    with pytest.raises(kineme.errors.TrajectoryError, match=r"a unit for each of 2 dimensions, got 1: \['m'\]"):
        ground(WAVE, primitives, units=["m"])


def test_preprocessing_travels_along():
    dmp = kineme.DMP(n_basis=20, preprocessing=(kineme.Smooth(8.0),))
    grounding = _read_back(ground(WAVE, dmp.learn(draw_kinds([3]))))
    VALIDATOR.validate(grounding)
    assert primitive_from(grounding).dmp == dmp


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda g: g.update(format="svg"), "expected a grounding, a mapping with format 'kineme-grounding', got 'svg'"),
        (lambda g: g.update(version=2), "of version 1 or earlier, got 2; upgrade kineme"),
        (lambda g: g.pop("dmp"), r"does not fit \(KeyError: 'dmp'\)"),
        (lambda g: g["primitive"].pop("goal"), r"does not fit \(KeyError: 'goal'\)"),
        (lambda g: g["primitive"].update(start=[1.0]), r"start should be finite float64 of shape \(2,\)"),
        (lambda g: g["primitive"].update(duration=-1.0), "duration should be above 0, is -1.0"),
        (lambda g: g["dmp"].update(n_basis=21), r"scaled_weights should be finite float64 of shape \(2, 21\)"),
        (lambda g: g["dmp"].update(stiffness="soft"), "expected stiffness to be a number above 0, got 'soft'"),
    ],
)  # fmt: skip
def test_what_is_no_grounding(spoil, message):
    grounding = _read_back(ground(WAVE, _learn(3)))
    spoil(grounding)
    with pytest.raises(kineme.errors.DataError, match=message):
        primitive_from(grounding)


def test_what_cannot_be_grounded():
    primitives = _learn(3)
    with pytest.raises(kineme.errors.TrajectoryError, match="at least one demonstration of 'wave', got none"):
        ground(WAVE, primitives[[]])
    with pytest.raises(
        kineme.errors.SpecificationError, match=r"expected by to be one of \['medoid', 'mean'\], got 'best'"
    ):
        ground(WAVE, primitives, by="best")
    with pytest.raises(kineme.errors.DataError, match=r"expected a grounding, a mapping .* got 'list'"):
        primitive_from([])


@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_medoid_is_not_the_one_that_differs(d):
    """Movements of one dimension do not differ in turning angles; the other representations tell."""
    demos = draw_kinds([1, 5], d, 0, spread=0.05)
    assert medoid_of(demos) > 0
