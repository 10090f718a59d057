"""A page for each command of ``kineme``, from the commands themselves, with examples from the pages."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

import click
from walk_through import pages as written_pages

from kineme.cli import main
from kineme.cli.options import READING, headings

#: Of commands that no page shows.
EXAMPLES = {
    "kineme library merge": ["kineme library merge wave greeting --into wave --library actions/"],
    "kineme library split": ["kineme library split wave --movement 4 --movement 7 --into greeting --library actions/"],
    "kineme library schema": ["kineme library schema > grounding.schema.json"],
    "kineme reproduce": ["kineme reproduce --out out/"],
}
_MOST = 3  # examples of a command
_SHOWN = re.compile(
    r"^(?:    |\$ )(kineme .+[^.\n])$(?!\n(?:kineme|Error): )", re.MULTILINE
)  # but what fails on purpose
_SIGNS = str.maketrans({"*": r"\*", "|": r"\|", "_": r"\_", "`": r"\`", "\\": r"\\"})


def pages() -> Iterator[tuple[str, str]]:
    """File name and text of each page, in reStructuredText."""
    examples = _examples()
    names = sorted(name for name, command in main.commands.items() if not command.hidden)
    about = "What each of them takes and writes, with examples. ``kineme --version`` says which kineme it is."
    lines = [*_title("Commands", "="), about, "", ".. list-table::", ""]
    for name in names:
        lines += [
            f"   * - :doc:`kineme {name} <kineme-{name}>`",
            f"     - {main.commands[name].get_short_help_str(90)}",
        ]
        yield from _command(main.commands[name], f"kineme {name}", examples)
    yield "commands.rst", "\n".join([*lines, "", _toctree(f"kineme-{name}" for name in names)])


def _command(command: click.Command, path: str, examples: dict[str, list[str]]) -> Iterator[tuple[str, str]]:
    """The page of a command, and those of the commands below it."""
    context = click.Context(command, info_name=path)
    file = path.replace(" ", "-")
    lines = _title(path, "=")
    if isinstance(command, click.Group):
        below = {name: one for name, one in sorted(command.commands.items()) if not one.hidden}
        lines += [*_text(command.help or ""), ".. list-table::", ""]
        for name, one in below.items():
            lines += [f"   * - :doc:`{path} {name} <{file}-{name}>`", f"     - {one.get_short_help_str(90)}"]
            yield from _command(one, f"{path} {name}", examples)
        yield f"{file}.rst", "\n".join([*lines, "", _toctree(f"{file}-{name}" for name in below)])
        return
    usage = " ".join([path, *command.collect_usage_pieces(context)])
    lines += [*_text(command.help or ""), ".. code-block:: text", "", f"   {usage}", ""]
    shown = examples.get(path) or EXAMPLES[path]
    lines += ["**As in**", "", ".. code-block:: bash", "", *(f"   {one}" for one in shown[:_MOST]), ""]
    yield f"{file}.rst", "\n".join([*lines, f".. program:: {path}", "", *_options(command, context)])


def _toctree(files: Iterable[str]) -> str:
    return "\n".join([".. toctree::", "   :hidden:", "", *(f"   {file}" for file in files), ""])


def _title(text: str, rule: str) -> list[str]:
    return [text, rule * len(text), ""]


def _text(text: str) -> list[str]:
    """The paragraphs of a help text, without its examples, which stand under their own heading."""
    paragraphs = [one.strip(" \n") for one in text.split("\n\n")]
    paragraphs = [paragraph for paragraph in paragraphs if not paragraph.startswith(("\b", "As in", "Example: "))]
    return [line for paragraph in paragraphs for line in (_sentence(paragraph), "")]


def _sentence(text: str) -> str:
    """On one line, and options as code, where two hyphens stay two."""
    return re.sub(r"(?<!\S)(--?[a-z][a-z-]*)", r"``\1``", " ".join(text.split()).translate(_SIGNS))


def _options(command: click.Command, context: click.Context) -> list[str]:
    lines: list[str] = []
    for words, options in headings(command, context).items():
        lines += [f".. rubric:: {words}", ""] if words != "Options" else []
        if words == READING and not getattr(command, "explains_reading", False):
            names = ", ".join(f":option:`{option.opts[0]} <kineme inspect {option.opts[0]}>`" for option in options)
            lines += [f"{names}: as of :doc:`kineme inspect <kineme-inspect>`.", ""]
            continue
        for option in options:
            record = option.get_help_record(context)
            if record is not None and record[1]:
                lines += [f".. option:: {record[0]}", "", f"   {_sentence(record[1])}", ""]
    return lines


def _examples() -> dict[str, list[str]]:
    """Command -> lines that call it, of its own help and of the pages, in which all of them are tried."""
    found: dict[str, list[str]] = {}
    texts = [page.read_text(encoding="utf-8") for page in written_pages()]
    texts = [
        *(f"    {line.strip().removeprefix('Example: ')}" for text in _helps(main) for line in text.splitlines()),
        *texts,
    ]
    for line in (re.sub(r"\s{2,}", "  ", line.strip()) for text in texts for line in _SHOWN.findall(text)):
        path = _path_of(line)
        if line not in found.setdefault(path, []):
            found[path].append(line)
    return found


def _helps(command: click.Command) -> Iterator[str]:
    yield command.help or ""
    if isinstance(command, click.Group):
        for below in command.commands.values():
            yield from _helps(below)


def _path_of(line: str) -> str:
    command: click.Command = main
    path = ["kineme"]
    for word in line.split()[1:]:
        if not isinstance(command, click.Group) or word not in command.commands:
            break
        command = command.commands[word]
        path.append(word)
    return " ".join(path)
