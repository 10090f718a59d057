"""Two averages blended: the product of their Gaussians at each time."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import DMP
from kineme.dmp.styles.parameters import map_rows, path_matrix
from kineme.errors import SpecificationError
from kineme.styles import average

AT = 60


def moments(mean):
    """Mean (T, d) and covariances (T, d, d) of the position at each time."""
    rows = map_rows(mean.factor, path_matrix(mean.primitive.dmp, AT)).transpose(2, 0, 1)
    return mean.primitive.rollout(n_samples=AT).positions[0], rows.transpose(0, 2, 1) @ rows


@pytest.fixture
def pair(dmp, demonstrate):
    return [average(dmp.learn(demonstrate(9, seed))) for seed in (0, 40)]


def test_it_is_the_product_of_gaussians(pair):
    one, other = pair
    a = np.linspace(0.1, 0.9, 5)
    found, covariances = moments(one.blend(other, a))
    activation = np.interp(np.linspace(0, 1, AT), np.linspace(0, 1, 5), a)
    size = np.abs(found).max()
    for t in range(0, AT, 7):
        precisions = [
            w * np.linalg.inv(moments(m)[1][t]) for m, w in zip(pair, (1 - activation[t], activation[t]), strict=True)
        ]
        expected = np.linalg.inv(sum(precisions))
        mean = expected @ sum(p @ moments(m)[0][t] for p, m in zip(precisions, pair, strict=True))
        np.testing.assert_allclose(found[t], mean, atol=0.02 * size)  # as closely as the basis functions follow
        np.testing.assert_allclose(covariances[t], expected, atol=0.05 * np.trace(expected))


@pytest.mark.parametrize("activation", [0.0, 1.0])
def test_alone_it_is_one_of_the_two(pair, activation):
    found, expected = pair[0].blend(pair[1], activation), pair[int(activation)]
    size = np.ptp(expected.primitive.rollout().positions)
    np.testing.assert_allclose(moments(found)[0], moments(expected)[0], atol=2e-3 * size)
    np.testing.assert_allclose(found.deviation(AT), expected.deviation(AT), atol=0.01 * size)
    assert found.primitive.durations[0] == pytest.approx(expected.primitive.durations[0])


def test_it_goes_over_from_one_to_the_other(pair):
    one, other = pair
    found = one.blend(other, [0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    x, a, b = (m.primitive.rollout(n_samples=AT).positions[0] for m in (found, one, other))
    size = np.ptp(a)
    assert np.linalg.norm(x[:15] - a[:15], axis=1).max() < 0.03 * size
    assert np.linalg.norm(x[-15:] - b[-15:], axis=1).max() < 0.03 * size
    taus = [float(m.primitive.durations[0]) for m in pair]
    assert found.primitive.durations[0] == pytest.approx(np.sqrt(taus[0] * taus[1]))


def test_the_certain_one_is_followed_and_order_does_not_matter(two_styles):
    learned = DMP().learn(two_styles(9)[0])
    wide = average(learned)
    narrow = wide.condition(t=0.5, position=[np.nan, wide.primitive.rollout(n_samples=101).positions[0, 50, 1] + 1.0])
    blend = wide.blend(narrow, 0.5)
    heights = [m.primitive.rollout(n_samples=101).positions[0, 50, 1] for m in (wide, narrow, blend)]
    assert abs(heights[2] - heights[1]) < 0.05 * abs(heights[0] - heights[1])
    reverse = narrow.blend(wide, 0.5)
    np.testing.assert_allclose(moments(reverse)[0], moments(blend)[0], atol=1e-9)
    np.testing.assert_allclose(moments(reverse)[1], moments(blend)[1], atol=1e-9)


def test_what_cannot_be_is_refused(pair, demonstrate):
    mean = pair[0]
    for activation in (1.5, [-0.1, 0.5], [np.nan], [], [[0.5]]):
        with pytest.raises(SpecificationError, match="expected activation to be numbers from 0 to 1"):
            mean.blend(mean, activation)
    with pytest.raises(SpecificationError, match="expected an AveragePrimitive to blend with, got Primitives"):
        mean.blend(mean.primitive, 0.5)
    with pytest.raises(SpecificationError, match="same specification"):
        mean.blend(average(DMP(n_basis=9).learn(demonstrate(3))), 0.5)
