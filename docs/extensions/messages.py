"""The page of all error messages, from the code that raises them, so that a search for one finds what to do."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import kineme

_ROOT = Path(kineme.__file__).parent
_BEGIN = "expected "  # messages that are put together elsewhere than where they are raised
_SHORTEST = 12  # characters of text; less does not tell one message from another

#: Folder of the code -> title of the section, and the pages to read.
_SECTIONS = {
    "io": ("Reading and writing files", "how-to/file-not-read.md", "guide/recordings.md"),
    "movements": ("Movements and their columns", "guide/columns.md"),
    "dmp": ("Learning and generating", "how-to/which-fit.md", "guide/moving-again.md", "guide/modulation.md"),
    "features": ("Features", "guide/scikit-learn.md"),
    "kernels": ("Kernels", "concepts/kernels.md"),
    "similarity": ("Comparing movements", "concepts/invariance.md", "guide/recognition.md"),
    "recognition": ("Recognizing", "how-to/everything-is-unknown.md", "guide/recognition.md"),
    "anchoring": ("Symbols", "concepts/anchoring.md"),
    "library": ("The action library", "tutorials/action-library.md"),
    "pieces": ("Archives beyond one machine", "guide/large-archives.md"),
    "robots": ("Arms", "guide/robots.md"),
    "studio": ("The studio and the page", "guide/studio.md", "guide/page.md"),
    "cli": ("The command line", "reference/generated/commands.rst"),
}
_OTHERS = ("Everywhere", "reference/generated/index.rst")
_SIGNS = re.compile(r"([\\`*_\[\]<>$|{}#])")


def pages() -> Iterator[tuple[str, str]]:
    """File name and text of the page, in Markdown."""
    sections: dict[tuple[str, ...], dict[str, None]] = {one: {} for one in (*_SECTIONS.values(), _OTHERS)}
    for path in sorted(_ROOT.rglob("*.py")):
        folder = path.relative_to(_ROOT).parts[0]
        for message in _messages(ast.parse(path.read_text(encoding="utf-8"))):
            sections[_SECTIONS.get(folder, _OTHERS)][message] = None
    yield "messages.md", "\n".join(_page(sections))


def _page(sections: dict[tuple[str, ...], dict[str, None]]) -> Iterator[str]:
    yield "# Error messages\n"
    yield "What kineme may answer, from its code: what was expected, what came instead and, where it is not plain,"
    yield "what to do. … stands for what differs. Each is a `kineme.errors.KinemeError`, or one of Python's own.\n"
    for (title, *read), messages in sections.items():
        if messages:
            yield f"## {title}\n\nRead {', '.join(f'[](../../{page})' for page in read)}.\n"
            yield from (f"- {message}" for message in sorted(messages, key=str.casefold))
            yield ""


def _messages(tree: ast.Module) -> Iterator[str]:
    raised = {id(node.exc.args[0]) for node in ast.walk(tree) if _raises(node)}
    whole = (ast.JoinedStr, ast.BinOp)
    parts = {
        id(part) for node in ast.walk(tree) if isinstance(node, whole) for part in ast.walk(node) if part is not node
    }
    for node in ast.walk(tree):
        text = _text(node) if id(node) not in parts else None
        if text is not None and (id(node) in raised or text.startswith(_BEGIN)):
            shown = re.sub("…+", "…", " ".join(text.split()))
            if len(shown.replace("…", "").strip()) >= _SHORTEST:
                yield _SIGNS.sub(r"\\\1", shown)


def _raises(node: ast.AST) -> bool:
    return isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and bool(node.exc.args)


def _text(node: ast.AST) -> str | None:
    """What an expression says, with … for what is put in; None if it is no text."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(str(one.value) if isinstance(one, ast.Constant) else "…" for one in values)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            parts = [_text(left), _text(right)]
            return None if parts == [None, None] else "".join(part or "…" for part in parts)
        case _:
            return None
