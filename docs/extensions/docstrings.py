"""Docstrings as Sphinx reads them: what is code stays as it is, formulas are typeset, names become links."""

from __future__ import annotations

import re
from itertools import groupby

from extensions.public import PUBLIC
from extensions.typeset import NoFormulaError, to_tex

_CODE = re.compile(r"(``[^`]+``|`[^`]+`)")
_INDENTED = re.compile(r"(?:(?<=\n\n)|\A)((?: {4}\S.*\n?|\n(?= {4}\S))+)(?=\n|\Z)")
_HEADING = re.compile(r"\n\n(?=[A-Z][A-Za-z ]+\n-{3,}\n)")
_IS_FORMULA = re.compile(r" [-=+~<>]|[\^/]|[\w)] \w|sqrt\(")
#: Signs that only formulas have, whatever words stand in them.
_FORMULA_FOR_CERTAIN = re.compile(r"\^|\b(?:exp|log|ln|sqrt|atan2|cot|phi|tau|alpha|theta|period|integral)\b(?!_)")


def to_rest(docstring: str) -> str:
    """What stands before the sections of a docstring as reStructuredText; the sections line by line."""
    prose, *sections = _HEADING.split(docstring)
    parts = _INDENTED.split(f"{prose}\n")
    prose = "".join(_block(part) if k % 2 else _prose(part) for k, part in enumerate(parts))
    return "\n\n".join([prose.rstrip(), *map(_section, sections)])


def _section(text: str) -> str:
    """A section such as Parameters; what stands before a colon at the margin is a name and stays as it is."""
    title, rule, *lines = text.split("\n")
    if title == "Examples":
        return text
    runs = ["\n".join(run) for _, run in groupby(lines, lambda line: line.startswith(" ") or not line)]
    return "\n".join(
        [title, rule, *(_prose(run) if run[:1] in {" ", "\n", ""} else _heads(run, title) for run in runs)]
    )


def _heads(lines: str, title: str) -> str:
    """Lines at the margin of a section: a name and its kind, or an error."""
    parts = [line.partition(" : ") for line in lines.split("\n")]
    unnamed = (lambda text: text) if title in {"Raises", "Warns"} else (lambda text: _prose(_linked(text)))
    return "\n".join(f"{name} : {_prose(_linked(kind))}" if colon else unnamed(name) for name, colon, kind in parts)


def _linked(kind: str) -> str:
    """The kind of a parameter, in which public names are links."""
    return re.sub(
        r"(?<![`\w.\"])[A-Z]\w+(?![\w\"(])", lambda word: f"`{word[0]}`" if word[0] in PUBLIC else word[0], kind
    )


def _prose(text: str) -> str:
    """Text with single signs that are markup elsewhere."""
    parts = _CODE.split(text)
    return "".join(_literal(part) if k % 2 else _plain(part) for k, part in enumerate(parts))


def _plain(text: str) -> str:
    """Signs that are none of markup, escaped; an emphasized word stays one."""
    parts = re.split(r"((?<!\w)\*\w+\*(?!\w))", text)
    parts[::2] = [re.sub(r"(?<=\w)_(?=\W|$)", r"\\_", re.sub(r"([*|\\])", r"\\\1", part)) for part in parts[::2]]
    return "".join(parts)


def _literal(text: str) -> str:
    if not text.startswith("``"):
        return text
    inside = " ".join(text.strip("`").split())
    if '"' in inside or not _IS_FORMULA.search(inside):
        return text
    try:
        return f":math:`{to_tex(inside, words=bool(_FORMULA_FOR_CERTAIN.search(inside)))}`"
    except NoFormulaError:
        return text


def _block(text: str) -> str:
    """Formulas one below the other, or whatever else is indented, as it is."""
    lines = [line for line in text.rstrip().split("\n") if line.strip()]
    try:
        rows = [_row(line) for line in lines]
    except NoFormulaError:
        return "::\n\n" + text.rstrip() + "\n"
    body = " \\\\\n   ".join(rows)
    return f".. math::\n\n   \\begin{{array}}{{lll}}\n   {body}\n   \\end{{array}}\n"


def _row(line: str) -> str:
    named = re.fullmatch(r"([a-z][a-z-]+)\s{2,}(.+)", line.strip())
    name, text = (named[1], named[2]) if named else ("", line.strip())
    text, _, equation = text.partition("Eq. ")
    formula = r",\qquad ".join(to_tex(one.strip(" ,"), words=True) for one in re.split(r",\s{3,}", text.strip(" ,.")))
    return rf"\text{{{name}}} & {formula}" + (rf" & \quad\text{{Eq. {equation}}}" if equation else "")
