"""Pictures of proposals show their members in the medoid's frame, in any number of dimensions."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import image

import kineme
import kineme.anchoring
from kineme.anchoring.figures import draw_map, draw_proposal, draw_proposals
from kineme.anchoring.proposals import propose
from kineme.anchoring.space import ConceptualSpace, conceptual_space
from kineme.movements.preparation.perturbations import Perturbation
from kineme.reporting.figures import flat, principal_axes, save_figure
from kineme.similarity.describe import paths_of
from soaking import slow
from unlabeled_samples import draw_kinds


@pytest.mark.parametrize("d", [1, 2, slow(3), slow(4)])
def test_pictures_of_any_dimension_are_written(d, tmp_path):
    demos = draw_kinds([5, 4, 2], d, 0)
    proposals = propose(demos)
    figures = {
        "one": draw_proposal(demos, proposals[0]),
        "sheet": draw_proposals(demos, proposals),
        "map": draw_map(conceptual_space("ab", demos[[0, 5]]), demos[[0, 5]]),
    }
    for name, figure in figures.items():
        picture = image.imread(save_figure(figure, tmp_path / f"{name}.png"))
        assert picture[:, :, :3].std() > 0.02  # not blank


def test_members_are_laid_onto_the_medoid():
    """Copies of one movement, shifted, scaled and turned, are drawn as one line; the inset shows them as recorded."""
    one = draw_kinds([1], 2, 0)
    copies = Perturbation(shift=2.0, scale=1.0, rotation=0.5).apply(one[[0] * 6], 0)
    both = kineme.Demonstrations([*copies, *draw_kinds([1, 6], 2, 1)[1:]])
    proposals = propose(both)
    axes = draw_proposal(both, next(one for one in proposals.proposals if 0 in one.members)).axes[0]
    *members, medoid, start = (np.array(line.get_data()) for line in axes.lines)
    for path in members:
        np.testing.assert_allclose(path, medoid, atol=1e-6 + 2e-3 * np.ptp(medoid))
    np.testing.assert_array_equal(start[:, 0], medoid[:, 0])
    (inset,) = axes.child_axes
    recorded = np.array([line.get_data() for line in inset.lines[:-1]])
    assert len(recorded) == 6
    np.testing.assert_allclose(recorded, paths_of(both)[:6])


def test_a_sheet_counts():
    demos = draw_kinds([5, 4, 6, 1], 2, 3, spread=0.03)
    proposals = propose(demos)
    titles = [axes.get_title() for axes in draw_proposals(demos, proposals).axes if axes.get_title()]
    assert [title.partition(" ×")[0] for title in titles[:-1]] == ["1:  6", "2:  5", "3:  4"]
    assert titles[-1] == "left over: 1"


@pytest.mark.parametrize("n", [2, 7, 26])
def test_drawings_on_a_map_do_not_overlap(n):
    rng = np.random.default_rng(n)
    demos = draw_kinds([1] * n, 2, n)
    distances = np.linalg.norm(rng.normal(size=(n, 1, 2)) * np.arange(1, n + 1)[:, None, None] ** -1.0, axis=2)
    space = ConceptualSpace(tuple(range(n)), np.abs(distances - distances.T))  # most of them in nearly one place
    figure = draw_map(space, demos)
    paths = np.array([line.get_data() for line in figure.axes[0].lines[::2]])  # every other one is a start
    low, high = paths.min(axis=2), paths.max(axis=2)
    assert np.isclose((high - low).max(axis=1), (high - low).max()).all()  # all of one size
    over = ((low[:, None] < high[None]) & (low[None] < high[:, None])).all(axis=2)
    assert over.sum() == n  # each with itself only
    assert figure.get_size_inches()[1] <= 8.0


def test_in_space_the_widest_view_is_shown():
    rng = np.random.default_rng(0)
    path = np.diag([1.0, 5.0, 3.0]) @ rng.normal(size=(3, 400))
    axes = principal_axes(path)
    np.testing.assert_allclose(axes @ axes.T, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(axes, [[0, 1, 0], [0, 0, 1]], atol=0.1)
    assert flat(path[None], path).shape == (1, 2, 400)


def test_what_is_higher_than_wide_stands_upright():
    """A digit in x and z, on a sheet that is tilted a little, is drawn as it was written."""
    rng = np.random.default_rng(1)
    written = rng.normal(size=(2, 400)) * [[1.0], [3.0]]
    path = np.stack((written[0], 0.2 * written[0] - 0.1 * written[1], written[1]))
    np.testing.assert_allclose(principal_axes(path), [[1, 0, 0], [0, 0, 1]], atol=0.25)


def test_pictures_of_other_movements():
    demos = draw_kinds([5, 4])
    proposals = propose(demos)
    with pytest.raises(kineme.errors.SpecificationError, match="at least 5, got 3"):
        draw_proposal(demos[:3], proposals[0])
    with pytest.raises(kineme.errors.SpecificationError, match=r"expected the 9 movements .* got 8"):
        draw_proposals(demos[:8], proposals)
    with pytest.raises(kineme.errors.SpecificationError, match="expected 2 prototypes, one per symbol, got 3"):
        draw_map(conceptual_space("ab", demos[:2]), demos[:3])


def test_every_public_name_leads_somewhere():
    for name in kineme.anchoring.__all__:
        assert getattr(kineme.anchoring, name).__doc__
    with pytest.raises(AttributeError, match=r"'kineme\.anchoring' has no attribute 'draw' .*; it has describe, "):
        _ = kineme.anchoring.draw
