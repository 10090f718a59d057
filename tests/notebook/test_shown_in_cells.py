"""Whatever a cell of a notebook may end with is shown: small, escaped, and in the color of the text around it."""

from __future__ import annotations

from xml.etree import ElementTree

import matplotlib.pyplot as plt
import numpy as np
import pytest

import kineme
from kineme.reporting.page import thumbnail
from kineme.reporting.table import Table, to_html

NAMES = ("<b>wave</b>", "\x1b[31mred", "ok")


def _labeled():
    """Two noisy movements of each name."""
    rng, u = np.random.default_rng(3), np.linspace(0, 1, 60)[:, None]
    paths = [np.hstack((u, np.sin((2 + k) * u))) + 0.01 * rng.normal(size=(60, 2)) for k in range(3) for _ in range(2)]
    return kineme.Demonstrations.from_arrays(paths, np.repeat(NAMES, 2))


DEMOS = _labeled()


def shown(thing):
    """The markup as elements: it is well formed, and holds no control characters."""
    text = thing._repr_html_()
    assert "<b>" not in text
    assert "\x1b" not in text
    return ElementTree.fromstring(f"<div>{text}</div>"), text


@pytest.mark.parametrize(
    ("make", "n_pictures"),
    [
        (lambda: DEMOS, 3),
        (lambda: DEMOS[0], 1),
        (lambda: kineme.DMP().learn(DEMOS), 6),
        (lambda: kineme.DMP().learn(DEMOS).rollout(), 3),
        (lambda: kineme.Recognizer().fit(DEMOS), 3),
        (lambda: kineme.Recognizer().fit(DEMOS).recognize(DEMOS[2]), 3),  # it, its nearest example, and the runner-up
    ],
    ids=["demonstrations", "movement", "primitives", "rollout", "recognizer", "answer"],
)
def test_movements_are_shown_with_their_pictures(make, n_pictures):
    elements, text = shown(make())
    assert len(elements.findall(".//svg")) == n_pictures
    assert "currentColor" in text
    assert len(text) < 8_000


def test_a_library_is_shown_by_its_symbols(tmp_path):
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        assert "<table>" in library._repr_html_()  # an empty one
        library.learn(DEMOS[2:])
        library.annotate("ok", "a last word")
        elements, text = shown(library)
        answer = library.recognize(DEMOS[2])
    assert len(elements.findall(".//svg")) == 2
    assert "a last word" in text
    assert "<td>2</td>" in text
    assert len(shown(answer)[0].findall(".//svg")) == 3


def test_an_explanation_is_its_picture_on_white_and_its_words():
    before = plt.get_fignums()
    text = kineme.Recognizer().fit(DEMOS).recognize(DEMOS[2]).explain()._repr_html_()
    assert plt.get_fignums() == before  # else the notebook would show it once more
    assert 'src="data:image/svg+xml;base64,' in text
    assert "<figcaption>looks like \\x1b[31mred: the same as an example" in text


def test_a_recognizer_is_no_box_of_scikit_learn():
    """It is asked for by the name that notebooks ask first."""
    bundle = kineme.Recognizer().fit(DEMOS)._repr_mimebundle_(include=None, exclude=None)
    assert bundle["text/html"].count("<svg") == 3
    assert kineme.Recognizer()._repr_mimebundle_()["text/html"] == "<pre>Recognizer()</pre>"


def test_of_many_movements_little_is_shown():
    rng = np.random.default_rng(0)
    many = kineme.Demonstrations.from_arrays(rng.random((3000, 300, 2)), [f"kind {k % 40}" for k in range(3000)])
    for thing in (many, kineme.DMP().learn(many[:200])):
        text = thing._repr_html_()
        assert text.count("<svg") == 20
        assert len(text) < 30_000
        assert "The first 20 of" in text


def test_every_text_of_a_table_is_escaped():
    text = to_html(Table("<i>", ("<b>", "<u>"), [("<s>", "<script>")], "<p>"))
    assert [mark for mark in ("<i>", "<b>", "<u>", "<s>", "<script>", "<p><p>") if mark in text] == []


@pytest.mark.parametrize("n_dims", [1, 2, 3, 7])
@pytest.mark.parametrize("size", [0.0, 1e-90, 1.0, 1e90])
def test_a_thumbnail_is_in_its_frame(n_dims, size):
    path = size * np.random.default_rng(n_dims).random((200, n_dims))
    svg = ElementTree.fromstring(thumbnail(path))
    points = np.array([pair.split() for pair in svg.find("path").get("d")[1:].split("L")], dtype=float)
    assert points.shape == (64, 2)
    assert ((points >= 7.9) & (points <= 92.1)).all()


def test_a_thumbnail_shows_the_plane_in_which_a_path_is_widest():
    u = np.linspace(0.0, 2.0 * np.pi, 65)[:-1]
    svg = ElementTree.fromstring(thumbnail(np.column_stack((0.01 * np.sin(3 * u), 2 * np.cos(u), np.sin(u)))))
    points = np.array([pair.split() for pair in svg.find("path").get("d")[1:].split("L")], dtype=float)
    assert sorted(np.ptp(points, axis=0).tolist()) == pytest.approx([42.0, 84.0], abs=1.0)


def test_a_thumbnail_stands_upright():
    """A path that rises to the right ends at the upper right, where pixels count from above."""
    svg = ElementTree.fromstring(thumbnail(np.array([[0.0, 0.0], [1.0, 1.0]])))
    assert svg.find("path").get("d") == "M8.0 92.0L92.0 8.0"
    assert (svg.find("circle").get("cx"), svg.find("circle").get("cy")) == ("8.0", "92.0")


def test_a_movement_has_the_views_of_many():
    movement = DEMOS[0]
    assert movement.plot().subfigs or movement.plot().axes
    axes = kineme.DMP().learn(DEMOS).plot().axes
    assert kineme.DMP().learn(DEMOS).plot().subfigs or axes
    pandas = pytest.importorskip("pandas")
    assert isinstance(movement.to_pandas(), pandas.DataFrame)
    assert movement.to_pandas()["label"].unique().tolist() == [NAMES[0]]
