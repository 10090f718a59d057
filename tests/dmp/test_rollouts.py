"""What every rollout can do, be it discrete, rhythmic or of poses."""

from __future__ import annotations

import io
import sys
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

import kineme
from kineme.dmp.discrete.rollout import BaseRollout
from kineme.orientation import PoseDMP, exp
from soaking import slow


def discrete():
    u = np.linspace(0.0, 1.0, 60)
    shown = [np.column_stack((u**k, np.sin(k * u))) for k in (1, 2, 3)]
    return kineme.DMP(n_basis=15, n_points=60).learn(kineme.Demonstrations.from_arrays(shown, ["a", "b", "a"]))


def rhythmic():
    t = np.linspace(0.0, 3.0, 200)
    shown = [np.column_stack((np.sin(k * t), np.cos(k * t))) for k in (7, 8, 9)]
    return kineme.RhythmicDMP().learn(kineme.Demonstrations.from_arrays(shown, ["a", "b", "a"], [t] * 3))


def poses():
    rise = np.linspace(0.0, 1.0, 50) ** 2
    shown = [np.hstack((np.outer(rise, [1.0, k, 0.0]), exp(np.outer(rise, [0.1, 0.2, k])))) for k in (0.5, 1.0, 1.5)]
    return PoseDMP(kineme.DMP(n_basis=15)).learn(kineme.Demonstrations.from_arrays(shown, ["a", "b", "a"]))


KINDS = {"discrete": discrete, "rhythmic": rhythmic, "poses": poses}
AXES = {"discrete": ["x", "y"], "rhythmic": ["x", "y"], "poses": ["x", "y", "z", "qw", "qx", "qy", "qz"]}
ARRAYS = ("times", "positions", "velocities", "accelerations")


@pytest.fixture(params=KINDS)
def kind(request):
    return request.param


@pytest.fixture
def rollout(kind):
    return KINDS[kind]().rollout()


def assert_same_movement(one, rollout, i):
    np.testing.assert_array_equal(one.times, rollout.times[i])
    np.testing.assert_array_equal(one.positions, rollout.positions[i])
    assert one.label == "aba"[i]


def test_it_gives_one_trajectory_after_the_other(rollout):
    assert isinstance(rollout, BaseRollout)
    movements = list(rollout)
    assert len(movements) == len(rollout) == 3
    for i, one in enumerate(movements):
        assert isinstance(one, kineme.Trajectory)
        assert_same_movement(one, rollout, i)


def test_a_truth_value_chooses_nothing(rollout):
    for index in (True, np.bool_(False)):
        with pytest.raises(IndexError, match="expected an index, a slice"):
            rollout[index]


def test_a_number_chooses_a_trajectory(rollout):
    for i in (0, 2, -1, np.intp(1)):
        assert isinstance(rollout[i], kineme.Trajectory)
        assert_same_movement(rollout[i], rollout, i)
    with pytest.raises(IndexError, match="expected an index below 3, got 3"):
        rollout[3]


@pytest.mark.parametrize("index", [slice(1, 3), [2, 0], np.array([False, True, True]), slice(None, None, -1)], ids=str)
def test_a_slice_mask_or_list_chooses_a_rollout(rollout, agree, index):
    some = rollout[index]
    assert type(some) is type(rollout)
    for name in ARRAYS:
        for one, other in zip(getattr(some, name), getattr(rollout, name)[index], strict=True):
            agree(one, other, 1e-12)
    assert some.labels.tolist() == rollout.labels[index].tolist()
    with pytest.raises(IndexError):
        rollout[[3]]


def test_of_one_primitive_that_moves_often_some_can_be_chosen(kind, agree):
    primitive = KINDS[kind]()[1]
    rollout = primitive.rollout(period=[0.5, 1.0, 2.0]) if kind == "rhythmic" else primitive.rollout(duration=[1, 2, 3])
    agree(rollout[1:].positions, rollout.positions[1:], 1e-12)
    agree(rollout[1:].times, rollout.times[1:], 1e-12)
    assert rollout.labels.tolist() == rollout.demonstrations.labels.tolist() == ["b"] * 3
    assert [one.label for one in rollout[[0, 2]]] == ["b", "b"]


def test_a_rhythm_that_starts_off_its_cycle_can_be_chosen_from(agree):
    rollout = rhythmic().rollout(start=[[1.0, 2.0], [0.0, 1.0], [3.0, 3.0]], velocity=[5.0, -5.0])
    agree(rollout[[2, 1]].positions, rollout.positions[[2, 1]], 1e-12)


def test_it_goes_in_wherever_movements_are_expected(kind, rollout):
    assert rollout.trajectories is rollout.demonstrations
    assert np.asarray(rollout).shape == rollout.positions.shape
    again = {"discrete": kineme.DMP(), "rhythmic": kineme.RhythmicDMP(aperiodic="accept"), "poses": PoseDMP()}[kind]
    assert len(again.learn(rollout)) == len(again.learn(list(rollout))) == 3


def test_a_recognizer_takes_it():
    primitives = discrete()
    recognizer = kineme.Recognizer().fit(primitives.rollout())
    assert recognizer.predict(primitives.rollout(duration=2.0)).tolist() == ["a", "b", "a"]


def test_it_has_a_picture(kind, rollout):
    figure = rollout.plot()
    assert isinstance(figure, Figure)
    assert {*AXES[kind], "time [s]"} <= {text for axes in figure.findobj(match=_is_axes) for text in _axis_labels(axes)}
    ends = ["start", "end"] if len(AXES[kind]) in (2, 3) else []
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["a", "b", *ends]
    figure.savefig(io.BytesIO())


def _is_axes(artist):
    return hasattr(artist, "get_xlabel")


def _axis_labels(axes):
    return axes.get_xlabel(), axes.get_ylabel()


@pytest.mark.parametrize("d", [1, slow(2), 3, slow(9)])
def test_a_picture_has_any_number_of_dimensions_and_not_too_many_lines(make_movement, d):
    primitive = kineme.DMP(n_basis=10).learn([make_movement(1, d)[1]])
    figure = primitive.rollout(goal=np.random.default_rng(0).normal(size=(500, d)), n_samples=20).plot()
    figure.savefig(io.BytesIO())
    assert figure.get_suptitle() == "50 of 500 movements"
    assert all(len(axes.lines) <= 150 for axes in figure.findobj(match=_is_axes))


def test_every_color_of_a_picture_has_a_name_or_there_is_one_color():
    u = np.linspace(0.0, 1.0, 30)
    for n, n_named in ((1, 0), (4, 4), (5, 5), (30, 30), (31, 0)):
        demos = kineme.Demonstrations.from_arrays(
            [np.column_stack((u, u**2))] * n, labels=[f"label {i}" for i in range(n)]
        )
        figure = kineme.DMP().learn(demos).rollout().plot()
        lines = [line for axes in figure.findobj(match=_is_axes) for line in axes.lines]
        assert len({to_rgba(line.get_color()) for line in lines}) == max(n_named, 1)
        assert sum(len(legend.get_texts()) for legend in figure.legends) == n_named + len(["start", "end"])


@pytest.fixture(autouse=True)
def _close_figures():
    yield
    if plt := sys.modules.get("matplotlib.pyplot"):
        plt.close("all")


def test_the_style_of_a_picture_is_its_own():
    before = dict(mpl.rcParams)
    discrete().rollout().plot()
    assert dict(mpl.rcParams) == before


def test_pyplot_knows_a_picture_where_it_is_imported(monkeypatch):
    plt = pytest.importorskip("matplotlib.pyplot")
    rollout = discrete().rollout()
    figure = rollout.plot()
    assert plt.gcf() is figure
    monkeypatch.setattr(mpl, "get_backend", lambda: "module://matplotlib_inline.backend_inline")
    with pytest.raises(NotImplementedError):  # so that IPython shows it as ever, and the end of the cell not again
        figure._ipython_display_()
    assert not plt.fignum_exists(figure.number)
    monkeypatch.delitem(sys.modules, "matplotlib.pyplot")
    assert type(rollout.plot()) is Figure


@pytest.mark.parametrize("d", [1, 2, 3])
def test_a_picture_is_drawn_into_axes_of_ones_own(make_movement, d):
    rollout = kineme.DMP(n_basis=10).learn([make_movement(1, d)[1]]).rollout(goal=np.zeros((60, d)), n_samples=20)
    flat, space = Figure().subplots(), Figure().subplots(subplot_kw={"projection": "3d"})
    right, wrong = (space, flat) if d == 3 else (flat, space)
    assert rollout.plot(ax=right) is right
    assert right.get_title() == "30 of 60 movements"
    assert len(right.lines) == (30 if d == 1 else 90)
    assert (right.get_xlabel(), right.get_ylabel()) == (("time [s]", "x") if d == 1 else ("x", "y"))
    legend = right.get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["start", "end"] if d > 1 else legend is None
    right.figure.savefig(io.BytesIO())
    with pytest.raises(
        kineme.errors.SpecificationError, match=rf"expected ax with .* for {d} dimensions, got projection"
    ):
        rollout.plot(wrong)


def test_axes_that_cannot_hold_a_picture_are_refused(make_movement):
    rollout = kineme.DMP(n_basis=10).learn([make_movement(1, 4)[1]]).rollout()
    with pytest.raises(kineme.errors.SpecificationError, match="at most 3 dimensions for one ax, got 4; leave ax out"):
        rollout.plot(Figure().subplots())
    with pytest.raises(kineme.errors.SpecificationError, match="expected ax to be an Axes of matplotlib, got Figure"):
        rollout.plot(Figure())


def test_a_movement_that_rests_has_a_picture_too(make_movement):
    primitive = kineme.DMP("original", n_basis=10).learn([make_movement(1, 3)[1]])
    here = primitive.starts[0]
    primitive.rollout(start=here, goal=here, velocity=np.zeros(3)).plot().savefig(io.BytesIO())


def test_a_table_has_a_row_for_each_sample(kind, rollout, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=dict))  # whatever is installed
    table = rollout.to_pandas()
    n, n_samples, _ = rollout.positions.shape
    assert list(table) == ["movement", "label", "time [s]", *AXES[kind]]
    assert table["movement"].tolist() == [i for i in range(n) for _ in range(n_samples)]
    assert table["label"].tolist() == ["aba"[i] for i in table["movement"]]
    np.testing.assert_array_equal(table["time [s]"], rollout.times.ravel())
    back = np.column_stack([table[name] for name in AXES[kind]]).reshape(n, n_samples, -1)
    np.testing.assert_array_equal(back, rollout.positions)


def test_a_table_without_labels_has_none(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=dict))
    table = kineme.DMP().learn([np.linspace(0, 1, 50) ** 2]).rollout(n_samples=5).to_pandas()
    assert table["label"].tolist() == [None] * 5


def test_a_table_needs_pandas(rollout, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        kineme.errors.DataError, match="expected the package pandas for a data frame; pip install pandas"
    ):
        rollout.to_pandas()


def test_pandas_takes_the_table(rollout):
    pandas = pytest.importorskip("pandas")
    table = rollout.to_pandas()
    assert isinstance(table, pandas.DataFrame)
    assert len(table) == rollout.times.size
