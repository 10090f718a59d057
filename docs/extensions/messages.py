"""Pages of all error messages, from the code that raises them, so that a search for one finds what to do."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import kineme

_ROOT = Path(kineme.__file__).parent
_BEGIN = "expected "  # messages that are put together elsewhere than where they are raised
_SHORTEST = 12  # characters of text; less does not tell one message from another

#: Folder of the code, or a room in it -> title of the page, and the pages to read.
_SECTIONS = {
    "io/arrays": ("Arrays: NumPy, JSON, MATLAB, HDF5", "how-to/file-not-read.md", "guide/arrays.md"),
    "io/lerobot": ("Data sets of LeRobot", "guide/lerobot.md", "guide/robot-data.md"),
    "io/motion_capture": ("Motion capture", "guide/motion-capture.md"),
    "io/ros": ("ROS bags", "guide/ros-bags.md"),
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
    "planning": ("Operators, plans and their execution", "how-to/planner.md", "how-to/monitor.md"),
    "robots": ("Arms", "guide/robots.md"),
    "studio": ("The studio and the page", "guide/studio.md", "guide/page.md"),
    "torch": ("Tensors", "guide/tensors.md"),
    "cli": ("The command line", "reference/generated/commands.rst"),
}
_OTHERS = ("Everywhere", "reference/generated/index.rst")
_ELSEWHERE = "elsewhere"
_ABOUT = """What kineme may answer, from its code: what was expected, what came instead and, where it is not plain,
what to do. Each is a `kineme.errors.KinemeError`, or one of Python's own. The search finds one by its words.
"""
_SIGN = "… stands for what differs."
_SIGNS = re.compile(r"([\\`*_\[\]<>$|{}#])")


def pages() -> Iterator[tuple[str, str]]:
    """File name and text of each page, in Markdown: one of all pages, and one for each part of the code."""
    sections: dict[str, dict[str, None]] = {folder: {} for folder in (*_SECTIONS, _ELSEWHERE)}
    for path in sorted(_ROOT.rglob("*.py")):
        folder, *rest = path.relative_to(_ROOT).parts
        room = f"{folder}/{rest[0]}" if rest else folder
        section = next((name for name in (room, folder) if name in _SECTIONS), _ELSEWHERE)
        for message in _messages(ast.parse(path.read_text(encoding="utf-8"))):
            sections[section][message] = None
    written = {f"messages-{name.replace('/', '-').replace('_', '-')}": name for name in sections if sections[name]}
    lines = ["# Error messages\n", _ABOUT, "By the part that says them:\n"]
    for file, name in written.items():
        title, *read = _SECTIONS.get(name, _OTHERS)
        lines.append(f"- [{title}]({file}.md): {len(sections[name]):,}")
        head = f"# Messages: {title}\n\nRead {', '.join(f'[](../../{page})' for page in read)}. {_SIGN}\n"
        yield f"{file}.md", "\n".join([head, *(f"- {text}" for text in sorted(sections[name], key=str.casefold)), ""])
    yield "messages.md", "\n".join([*lines, "\n```{toctree}\n:hidden:\n", *written, "```", ""])


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
