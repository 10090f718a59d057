"""What makes the site of the documentation: formulas, docstrings, commands, and the check of the finished pages."""

from __future__ import annotations

import re
import shlex
from types import SimpleNamespace

import click
import pytest
from extensions import commands, equations, formats, leftovers, public, readers, routes, typeset, whole
from extensions.docstrings import to_rest
from walk_through import DOCS

from kineme.cli import main


@pytest.mark.parametrize(
    ("formula", "tex"),
    [
        ("x'' = K (g - x) - D x'", "x''=K(g-x)-Dx'"),
        (
            "f(s) = sum_i psi_i(s) w_i / sum_i psi_i(s)",
            r"f(s)=\frac{\sum _{i}\psi _{i}(s)w_{i}}{\sum _{i}\psi _{i}(s)}",
        ),
        ("exp(-‖x - y‖² / (2 σ²))", r"\exp \left(-\frac{\lVert x-y\rVert ^2}{2\sigma ^2}\right)"),
        ("2 sqrt(K)", r"2\sqrt{K}"),
        ("x0^(1 - a)", "x_{0}^{1-a}"),
        ("S A' (A S A')^-1 e", "SA'(ASA')^{-1}e"),
        ("|p - p*|^2", r"\lvert p-p^{*}\rvert ^2"),
        ("1 / (h (2 pi)^4)", r"\frac{1}{h(2\pi )^4}"),
    ],
)
def test_formulas_are_typeset(formula, tex):
    assert typeset.to_tex(formula) == tex


@pytest.mark.parametrize(
    "code", ['fit="forcing"', "value = other", "(a", "a)", "max_angle: 3", "max_angle=3", "sum(q[t])", "", "kineme.DMP"]
)
def test_code_is_no_formula(code):
    with pytest.raises(typeset.NoFormulaError):
        typeset.to_tex(code)


def test_docstrings_become_text_that_sphinx_reads():
    text = to_rest(
        "Give *it* a * to `DMP` and ``x_i = a / b``, not ``max_angle=3``.\n\n    x' = v    Eq. (1)\n\nParameters\n"
        "----------\nw_ : Rollout, optional\n    Of |x|.\n\nRaises\n------\nDataError\n    No."
    )
    assert r"Give *it* a \* to `DMP` and :math:`x_{i}=\frac{a}{b}`, not ``max_angle=3``." in text
    assert ".. math::\n\n   \\begin{array}{lll}\n   \\text{} & x'=v & \\quad\\text{Eq. (1)}" in text
    assert "w_ : `Rollout`, optional\n    Of \\|x\\|." in text
    assert text.endswith("Raises\n------\nDataError\n    No.")


def test_code_over_two_lines_and_formulas_with_words_are_read():
    text = to_rest("``p = a\nb`` with ``phi = t / period`` and ``u = t / h``, ``goal + duration * v``")
    assert text.count(":math:") == 3
    assert r":math:`\phi =\frac{t}{\text{period}}`" in text
    assert text.rstrip().endswith("``goal + duration * v``")


def test_every_route_of_the_studio_is_on_one_page():
    described = routes.description()
    text = "".join(text for _, text in routes.pages())
    for path, ways in described["paths"].items():
        assert all(text.count(f"\n## {way.upper()} {path}\n") == 1 for way in ways)
    assert all(text.count(f"\n### {name}\n") == 1 for name in described["components"]["schemas"])
    assert "Takes [RolloutRequest](#json-RolloutRequest)." in text
    assert "| `error_rate` (optional) | number; above 0; below 1; default `0.05` |" in text


def test_arrows_of_the_navigation_have_names():
    context = {"generate_toctree_html": lambda kind: '<a href="#">Robots</a><details><summary></summary></details>'}
    readers.mend_page(None, "index", "page.html", context, None)
    assert 'aria-label="Pages below Robots"' in context["generate_toctree_html"]("sidebar")


def test_every_command_has_a_page():
    """With an example, of its help or of a page, where all are tried; here those that no page shows."""
    named = {*main.commands, *(f"library-{name}" for name in main.commands["library"].commands)}
    assert set(dict(commands.pages())) == {"commands.rst", *(f"kineme-{name}.rst" for name in named)}


def test_examples_of_a_help_stand_under_their_heading():
    page = dict(commands.pages())["kineme-learn.rst"]
    assert "Example:" not in page
    assert "**As in**\n\n.. code-block:: bash\n\n   kineme learn recordings/ --library actions/\n" in page


def test_options_for_reading_are_explained_on_one_page():
    pages = dict(commands.pages())
    assert [name for name, page in pages.items() if ".. option:: --follow-links" in page] == ["kineme-inspect.rst"]
    assert ":option:`--trim <kineme inspect --trim>`" in pages["kineme-learn.rst"]
    assert ".. rubric:: Arm" in pages["kineme-move.rst"]


@pytest.mark.parametrize("line", [line for lines in commands.EXAMPLES.values() for line in lines])
def test_examples_of_commands_parse(line):
    command, context, words = main, click.Context(main), shlex.split(line.partition(" > ")[0])[1:]
    while isinstance(command, click.Group):
        _, command, words = command.resolve_command(context, words)
        context = click.Context(command, parent=context)
    command.parse_args(context, words)


def test_every_equation_of_the_paper_is_somewhere_in_the_code():
    page = (DOCS / "reference" / "equations.md").read_text(encoding="utf-8")
    assert [f"{{cited-in}} {number}" in page for number in range(1, 10)] == [True] * 9
    assert set(equations.places()) == set(range(1, 10))
    assert "kineme.kernels.TruncatedEuclidean" in equations.places()[7]


def test_every_format_is_on_its_page():
    text = dict(formats.pages())["formats.md"]
    assert all(f"`{ending}`" in text for ending in formats.FORMATS)


def test_public_names_are_found_under_what_users_write():
    assert public.PUBLIC["DMP"] == public.PUBLIC["kineme.dmp.discrete.dmp.DMP"] == "kineme.DMP"
    assert public.PUBLIC["kernels.RBF"] == "kineme.kernels.RBF"


@pytest.mark.parametrize(
    ("markup", "wrong"),
    [
        ('<script src="https://cdn.example/a.js"></script>', "loads"),
        ('<img src="//cdn.example/a.png">', "loads"),
        ("<img src='https://cdn.example/a.png'>", "loads"),
        ("<img src=https://cdn.example/a.png>", "loads"),
        ('<img srcset="page.html 1x, https://cdn.example/a.png 2x">', "loads"),
        ('<object data="https://cdn.example/a.svg"></object>', "loads"),
        ('<b style="background: url(&quot;https://cdn.example/a.png&quot;)">x</b>', "loads"),
        ("<style>\n@import 'https://fonts.example/css';\n</style>", "loads"),
        ('<img alt="a > b" src="missing.png">', "loads missing.png"),
        ('<script src="_static/missing.js?v=1"></script>', "loads _static/missing.js"),
        ("<script>show('<img src=missing.png>')</script>", None),
        ('<link href="page.html?v=1">', None),
        ('<a href="other.html">', "links to other.html"),
        ('<a href="#nowhere">', "links to #nowhere"),
        ('<a href="#here">', None),
        ('<a href="https://example.org">', None),
        ('<img src="data:image/png;base64,AA==">', None),
    ],
)
def test_the_check_of_the_site_finds_what_is_wrong(tmp_path, markup, wrong):
    (tmp_path / "page.html").write_text(f'<p id="here">{markup}</p>')
    found = list(whole.problems(tmp_path))
    assert found == [] if wrong is None else len(found) == 1 and wrong in found[0]


def test_the_check_of_the_site_reads_style_sheets(tmp_path):
    (tmp_path / "a.css").write_text("@import 'https://fonts.example/css'; p { background: url(a.png) }")
    assert [line.partition("loads ")[2] for line in whole.problems(tmp_path)] == ["https://fonts.example/css"]


def _tree(folder, *files):
    for file in files:
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text("")


def _files(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_what_the_gallery_made_of_scripts_that_are_gone_is_removed(tmp_path):
    _tree(tmp_path / "examples", "kernels/plot_one.py")
    gallery = tmp_path / "docs" / "gallery"
    kept = {"index.rst", "backreferences/kineme.DMP.examples", "kernels/index.rst", "kernels/plot_one.codeobj.json"}
    _tree(gallery, *kept, "kernels/plot_two.rst", "kernels/plot_two.py.md5", "old/index.rst", "old/images/a.png")
    leftovers.remove_scripts(SimpleNamespace(srcdir=tmp_path / "docs"))
    assert _files(gallery) == kept


def test_pages_that_were_deleted_leave_the_site_and_the_others_are_written_again(tmp_path):
    env = SimpleNamespace(found_docs={"index", "how-to/read"})
    builder = SimpleNamespace(format="html", get_target_uri=lambda page: f"{page}.html")
    kept = {"index.html", "how-to/read.html", "search.html", "_static/webpack-macros.html", "objects.inv"}
    _tree(tmp_path, *kept, "how-to/gone.html")
    leftovers.remove_pages(SimpleNamespace(outdir=tmp_path, builder=builder, env=env), None)
    assert _files(tmp_path) == kept
    assert set(leftovers.outdated(None, env, set(), {"index"}, {"how-to/gone"})) == env.found_docs
    assert leftovers.outdated(None, env, set(), {"index"}, set()) == []


def test_the_first_picture_is_whole_when_it_begins():
    """A page that opens with an empty frame says nothing in its first second."""
    picture = (DOCS / "images" / "kineme.svg").read_text(encoding="utf-8")
    delays = re.findall(r"animation:\w+ 9.0s linear( -7.6s)? infinite", picture)
    assert len(delays) == 11
    assert all(delays)


@pytest.mark.parametrize("name", ["kineme", "moving-goal"])
def test_moving_pictures_are_small_and_look_right_in_the_dark_and_without_motion(name):
    picture = (DOCS / "images" / f"{name}.svg").read_text(encoding="utf-8")
    assert len(picture) < 20_000
    assert "@media (prefers-color-scheme:dark){:root{--paper:none;" in picture
    assert "@media (prefers-reduced-motion:reduce)" in picture
    assert not re.search(r'fill="#', picture)  # colors that would stay as they are


def test_a_movement_ends_at_the_goal_that_moved():
    picture = (DOCS / "images" / "moving-goal.svg").read_text(encoding="utf-8")
    places = {
        name: [float(x) for x in re.findall(rf"@keyframes {name}{{.*?100%{{transform:translate\((.+?)px,", picture)]
        for name in ("tip", "goal")
    }
    starts = re.findall(r"@keyframes goal{0%{transform:translate\((.+?)px,", picture)
    assert abs(places["tip"][0] - places["goal"][0]) < 8
    assert places["goal"][0] - float(starts[0]) > 50
