"""House rules that a linter does not know: sizes, names, and nothing of anyone's machine in a tracked file."""

from __future__ import annotations

import ast
import re
import subprocess
from collections import Counter
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = sorted([*(ROOT / "src").rglob("*.py"), *(ROOT / "experiments" / "kineme_experiments").rglob("*.py")])
MAX_FILE, MAX_FUNCTION = 400, 60


@cache  # the sources do not change while they are read here
def _nodes(path):
    """All nodes of a file's syntax tree, the module first."""
    return tuple(ast.walk(ast.parse(path.read_text())))


@cache
def _code_lines(path):
    """Numbers of the lines that hold code: no blank lines, comments or docstrings; all lines of other long texts."""
    texts = [node for node in _nodes(path) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    docstrings = {
        line
        for node in _nodes(path)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        for line in range(node.lineno, node.end_lineno + 1)
    }
    lines = enumerate(path.read_text().splitlines(), start=1)
    code = {number for number, line in lines if line.strip() and not line.lstrip().startswith("#")}
    code.update(line for text in texts for line in range(text.lineno, text.end_lineno + 1))
    return code - docstrings


@cache
def _functions_of(path):
    return [node for node in _nodes(path) if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))]


def test_files_and_functions_are_short():
    """Lines of code are counted only where lines of any kind are too many."""
    long = [
        path for path in SOURCES if len(path.read_text().splitlines()) > MAX_FILE
        or any(node.end_lineno - node.body[0].lineno >= MAX_FUNCTION for node in _functions_of(path))
    ]  # fmt: skip
    code = {path: _code_lines(path) for path in long}
    assert not {str(path.relative_to(ROOT)): len(lines) for path, lines in code.items() if len(lines) > MAX_FILE}
    lengths = {
        f"{path.relative_to(ROOT)}: {node.name}": len(lines & set(range(node.body[0].lineno, node.end_lineno + 1)))
        for path, lines in code.items()
        for node in _functions_of(path)
    }
    assert not {name: length for name, length in lengths.items() if length > MAX_FUNCTION}


#: Limits of the package. They are lowered as it gets lighter, and never raised in passing.
BUDGET = {
    "files": 400,
    "lines": 79_975,
    "lines of imports in code": 0.10,
    "private functions called once": 0.12,
    "empty names": 0.01,
    "docstrings that begin with a clause": 0.02,
}
#: Names that say nothing of what they hold.
_EMPTY = {"one", "found", "made", "known", "told", "asked", "kept", "whole"}
_CLAUSES = {"what", "whether", "how", "which", "where", "that", "who", "why", "as", "if", "when"}


def test_the_package_stays_within_its_budget():
    """Limits of the whole: where one is reached, something is to be said in less."""
    paths = sorted((ROOT / "src" / "kineme").rglob("*.py"))
    nodes = [node for path in paths for node in _nodes(path)]
    lines = sum(path.read_text().count("\n") for path in paths)
    imports = [node for node in nodes if isinstance(node, (ast.Import, ast.ImportFrom))]
    functions = [node.name for node in nodes if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))]
    uses = Counter(node.id for node in nodes if isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Store))
    uses.update(node.attr for node in nodes if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load))
    private = [name for name in functions if re.match(r"_(?!_)", name)]
    bound = [node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    bound += [node.arg for node in nodes if isinstance(node, ast.arg)]
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    first_words = [text.split()[0].strip("`,.").lower() for node in nodes if isinstance(node, documented)
                   if (text := ast.get_docstring(node))]  # fmt: skip
    spent = {
        "files": len(paths),
        "lines": lines,
        "lines of imports in code": sum(node.end_lineno - node.lineno + 1 for node in imports)
        / sum(len(_code_lines(path)) for path in paths),
        "private functions called once": sum(uses[name] == 1 for name in private) / len(functions),
        "empty names": sum(name in _EMPTY for name in bound) / len(bound),
        "docstrings that begin with a clause": sum(word in _CLAUSES for word in first_words) / len(first_words),
    }
    assert not {what: (value, BUDGET[what]) for what, value in spent.items() if value > BUDGET[what]}


_CHANGE = {"LibraryRecognizer", "Batch", "Decision"}  # what is remembered between calls


def _classes():
    return [node for path in SOURCES for node in _nodes(path)[0].body if isinstance(node, ast.ClassDef)]


def test_named_tuples_check_nothing_and_are_sequences_of_their_fields():
    tuples = [one for one in _classes() if any(getattr(base, "id", "") == "NamedTuple" for base in one.bases)]
    own = {"__new__", "__len__", "__iter__", "__getitem__", "__eq__", "__hash__"}
    assert tuples
    assert not [one.name for one in tuples for node in one.body if getattr(node, "name", "") in own]


def test_dataclasses_are_frozen_but_for_those_that_change():
    made = [(one.name, ast.unparse(each)) for one in _classes() for each in one.decorator_list]
    assert {name for name, text in made if text.startswith("dataclass") and "frozen=True" not in text} <= _CHANGE


def test_no_file_is_a_drawer_for_anything():
    drawers = {"util", "utils", "helper", "helpers", "common", "misc"}
    assert not [path for path in SOURCES if path.stem.strip("_") in drawers or path.parent.name in drawers]


def test_test_files_have_names_of_their_own():
    """Tests are no packages, so that they import their samples plainly; two of one name could not both be loaded."""
    names = sorted(path.name for path in (ROOT / "tests").rglob("*.py") if path.name != "conftest.py")
    assert [one for one, other in pairwise(names) if one == other] == []


_S_FOR_Z = (
    "discreti", "generali", "initiali", "maximi", "minimi", "normali", "optimi", "organi", "orthogonali", "parametri",
    "randomi", "reali", "recogni", "regulari", "seriali", "speciali", "summari", "synchroni", "vectori", "visuali",
)  # fmt: skip
_BRITISH = re.compile(  # each alternative begins with a letter: such a search is ten times as fast
    "|".join(rf"{stem}s(?:e[drs]?|ing|ations?)\b" for stem in _S_FOR_Z)
    + r"|analyse(?<!\wanalyse)[ds]?\b|analysing\b|neighbour|colour|behaviour|favour|artefact|catalogue|licence"
    r"|centre[ds]?\b|metres?\b|grey|learnt\b|labelled|labelling|modelled|modelling|travelled|travelling|judgement|whilst"
)


_OF_OTHERS = {"behaviour", "behaviour_tree_xml", "parse_behaviour_tree_xml"}  # names in py_trees


def test_warnings_are_given_in_one_way():
    """By `kineme.errors.warn`, which `heard_warnings` hears."""
    given = {path.name for path in SOURCES if re.search(r"\bwarnings(\.| import )warn\b", path.read_text())}
    assert given == {"errors.py"}


def test_spelling_is_american():
    texts = {".py", ".pyi", ".md", ".toml", ".json", ".in", ""}
    pages = [path for path in _tracked() if path.suffix in texts and "results" not in path.parts]
    words = {
        str(page.relative_to(ROOT)): set(re.findall(r"\w+", page.read_text(encoding="utf-8").lower())) for page in pages
    }
    assert {"pyproject.toml", "CHANGELOG.md", "src/kineme/__init__.py", "tests/conftest.py"} < set(words)
    british = {word for word in set().union(*words.values()) if _BRITISH.search(word)} - _OF_OTHERS
    assert not {page: british & of_page for page, of_page in words.items() if british & of_page}


def _tracked():
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a git checkout")
    paths = [ROOT / name for name in listed.stdout.split("\0") if name]
    return [path for path in paths if path.is_file() and path != Path(__file__)]


@pytest.mark.parametrize(
    ("what", "pattern"),
    [
        ("a path of someone's machine", rb"(?<![\w.}$/-])/(?:home|root|Users|work|mnt|tmp|opt)/[\w.-]+"),
        ("the address of a package index", rb"(?:--(?:extra-)?index-url|/simple/|https?://[\w.:@-]*(?:pypi|artifactory|nexus)[\w.:/-]*)"),
        ("a user name in an address", rb"https?://[^\s/@]+@"),
    ],
)  # fmt: skip
def test_no_tracked_file_contains(what, pattern):
    found = {
        str(path.relative_to(ROOT)): match[0] for path in _tracked() if (match := re.search(pattern, path.read_bytes()))
    }
    assert not found, what


#: Words for which the field has others: score, options, neighbor, weight, cluster map, grounding.
_PRIVATE = {
    "judge",
    "wish",
    "wishes",
    "mate",
    "mates",
    "speak",
    "speaks",
    "loud",
    "shout",
    "unheard",
    "sheet",
    "regain",
    "seen",
}


def _names(path):
    """What a file names: functions, classes, arguments and variables."""
    for node in _nodes(path):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            yield node.name
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id


def test_names_are_the_fields_words():
    named = {name for path in SOURCES for name in _names(path)}
    words = {name: set(re.sub("([a-z])([A-Z])", r"\1_\2", name).lower().split("_")) for name in named}
    assert not {name for name, parts in words.items() if parts & _PRIVATE}
