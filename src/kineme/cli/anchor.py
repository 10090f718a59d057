"""``kineme anchor``: propose symbols among unlabeled movements, and accept them in a dialogue or by options."""

from __future__ import annotations

import json
import sys
from collections import deque
from pathlib import Path
from typing import Any, NamedTuple

import click

from kineme.cli.options import FOLDER, ID, Parsed, json_option, library_option, opened, whole
from kineme.cli.output import ask, confirm, say, table, write
from kineme.errors import DataError, KinemeError
from kineme.reporting.text import counted, printable

HELP = """\
  a name         makes it a symbol, or joins the symbol of that name
  /yes           takes the name that is proposed
  (nothing)      leaves it for later
  /split         looks for two clusters in it
  /reject        leaves its movements unnamed, and does not propose it again
  /members       lists its movements
  /name TEXT     a name that begins with a slash
  /quit          stops; what is named stays"""

COMMANDS = "/split, /reject, /members, /name, /yes, /quit"

_SHOWN = 5  # remaining movements that are listed


def _choice(text: str) -> list[int] | str:
    """Numbers of proposals separated by commas, or "all"."""
    try:
        return text if text == "all" else [int(part) for part in text.split(",")]
    except ValueError:
        raise ValueError(f"expected numbers of proposals separated by commas, or all, got {text!r}") from None


_CHOICE = Parsed("1,2,...|all", _choice)


@click.command(short_help="Turn unlabeled movements into symbols.")
@library_option
@click.option("--method", type=click.Choice(["spectral", "agglomerative", "hdbscan"]),
              help="Clustering.  [default: members as similar as those of the stored symbols; spectral where there are "
              "none]")  # fmt: skip
@click.option("--clusters", type=whole(1), help="Number of clusters.  [default: chosen from the data]")
@click.option(
    "--min-members", type=whole(2), default=3, show_default=True, help="Smallest number of movements in a proposal."
)
@click.option("--join/--no-join", default=True, show_default=True,
              help="First add movements to the symbols that they are recognized as.")  # fmt: skip
@click.option("--accept", type=_CHOICE, help="Accept these proposals without asking.")
@click.option("--reject", type=_CHOICE, help="Reject these proposals, and do not propose their movements again.")
@click.option("--at", "expected", type=ID,
              help="Only if the library is still at this version, as the list says it.")  # fmt: skip
@click.option("--names", type=click.Path(exists=True, dir_okay=False, path_type=Path),
              help='A JSON file of names: {"1": "wave", "2": "nod"}.  [default: proposed, or cluster 1]')  # fmt: skip
@click.option("--pictures", type=FOLDER, default="proposals", show_default=True,
              help="Folder for a picture of every proposal.")  # fmt: skip
@json_option
def anchor(folder: Any, **options: Any) -> None:
    """Propose symbols among the unlabeled movements, and accept them.

    On a terminal it asks about each proposal. With --accept or --reject it does not ask, and lists the proposals that
    remain: they have new numbers then. Otherwise it changes nothing and lists the proposals by the numbers that
    --accept takes. Where others change the library meanwhile, the numbers may mean others: with --at and the version of
    the list, they are refused then.

    Example: kineme anchor --library actions/ --accept all --names names.json
    """
    import numpy as np

    from kineme.library.proposals import assign_recognized

    scripted = options["accept"] is not None or options["reject"] is not None
    expected = options["expected"]
    if expected is not None and not scripted:
        raise click.UsageError("expected --at with --accept or --reject, got neither")
    interactive = not scripted and not options["as_json"] and sys.stdin.isatty()
    names = _names(options["names"])
    writes = scripted or interactive
    with opened(folder, read_only=not writes) as library:
        version = library.version  # before proposals are made of it
        joining, proposals = _proposed(library, options)
        if expected is not None and expected != library.version:
            raise DataError(
                f"expected the library at version {expected}, as it was listed, it is at version {library.version} by "
                "now; nothing was changed: list the proposals again"
            )
        accepted = _chosen(proposals, options["accept"], "--accept")
        rejected = _chosen(proposals, options["reject"], "--reject")
        if both := set(accepted) & set(rejected):
            raise click.UsageError(f"expected each proposal accepted or rejected, got both for {min(both)}")
        _chosen(proposals, [*names], "--names")
        pictures = _draw(library, proposals, options["pictures"])
        data = {
            "joined": assign_recognized(library.store, joining) if writes else {},
            "would_join": {} if writes else {name: len(ids) for name, ids in joining.ids.items()},
            **_as_data(proposals),
            "pictures": [str(path) for path in pictures],
        }
        alone = _alone(library, proposals)
        if interactive:
            write(_text(data, alone))
            Session(library, proposals, pictures[1:]).run()
            return
        data["accepted"] = {}
        for number in accepted:
            taken = {symbol.name for symbol in library.symbols()}
            free = (f"cluster {k}" for k in range(number, number + len(taken) + 1) if f"cluster {k}" not in taken)
            name = names.get(number) or proposals[number - 1].name or next(free)
            without = np.intersect1d(proposals[number - 1].members, library.unlabeled())
            library.accept(proposals[number - 1], name)
            data["accepted"][name] = data["accepted"].get(name, 0) + len(without)
        for number in rejected:
            library.reject(proposals[number - 1])
        data["rejected"] = rejected
        shown = data
        version = library.version if scripted else version
        joining, remaining = _proposed(library, options) if scripted else (joining, proposals)
        data["version"] = version
        if scripted and len(remaining.ids):
            data["remaining"] = _as_data(remaining)["proposals"]
            data["pictures"] = [str(path) for path in _draw(library, remaining, options["pictures"])]
            would_join = {name: len(ids) for name, ids in joining.ids.items()}
            shown, alone = data | _as_data(remaining) | {"would_join": would_join}, _alone(library, remaining)
    say(options["as_json"], data, lambda: _text(shown, alone))


def _proposed(library: Any, options: dict[str, Any]) -> tuple[Any, Any]:
    """Return movements that join a symbol, and proposals among the others: listed and accepted by the same numbers."""
    from kineme.library.proposals import Recognized, propose, recognized

    joining = recognized(library.store) if options["join"] else Recognized()
    how = options["method"], options["clusters"], options["min_members"]
    return joining, propose(library.store, None, *how, joining)


def _alone(library: Any, proposals: Any) -> str:
    """Name the first movements that are left over."""
    ids = proposals.left_over
    if not len(ids):
        return ""
    shown = library.movements(ids=ids[:_SHOWN]).names or ()
    words = [printable(name or key) for name, key in zip(shown, ids.tolist(), strict=False)]
    return ": " + ", ".join([*words, *(["..."] if len(ids) > _SHOWN else [])])


def _names(path: Path | None) -> dict[int, str]:
    from kineme.library.storage.symbols import check_name

    if path is None:
        return {}
    try:
        names = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(names, dict):
            raise ValueError("no numbers of proposals")
        by_number = {int(number): check_name(name) for number, name in names.items()}
        if min(by_number, default=1) < 1:
            raise ValueError(f"proposals are counted from 1, got {min(by_number)}")
        return by_number
    except ValueError as error:
        raise DataError(
            f'expected {path} to hold names by the number of the proposal, as {{"1": "wave"}}, got something else '
            f"({error})"
        ) from error


def _draw(library: Any, proposals: Any, folder: Path) -> list[Path]:
    """Draw an overview of all proposals, then a picture of each."""
    from kineme.anchoring.figures import draw_proposal, draw_proposals
    from kineme.reporting.figures import save_figure

    if not len(proposals):
        return []
    overview = folder / "all.png"
    if overview.exists() and not (folder / "proposal-1.png").exists():
        raise click.UsageError(
            f"expected a folder without other pictures, {printable(overview)} is there, not of an earlier run; choose "
            "another folder with --pictures"
        )
    folder.mkdir(parents=True, exist_ok=True)
    movements = library.movements(ids=proposals.ids)
    like = library.specification.comparison
    paths = [save_figure(draw_proposals(movements, proposals.by_position, like), overview)]
    for number, proposal in enumerate(proposals.by_position.proposals, 1):
        paths.append(save_figure(draw_proposal(movements, proposal, like=like), folder / f"proposal-{number}.png"))
    number = len(proposals) + 1
    while (stale := folder / f"proposal-{number}.png").exists():  # of an earlier run
        stale.unlink()
        number += 1
    return paths


def _chosen(proposals: Any, choice: Any, option: str) -> list[int]:
    """Return numbers of proposals, from 1."""
    numbers = range(1, len(proposals) + 1) if choice == "all" else choice or []
    for number in numbers:
        if not 1 <= number <= len(proposals):
            raise click.BadParameter(
                f"there are {len(proposals)} proposals, counted from 1, got {number}", param_hint=option
            )
    return list(dict.fromkeys(numbers))


def _as_data(proposals: Any) -> dict[str, Any]:
    return {
        "proposals": [
            {
                "number": number,
                "movements": proposal.members.tolist(),
                **{name: getattr(proposal, name) for name in ("medoid", "cohesion", "stability", "name")},
                "nearest": None if proposal.nearest is None else proposal.nearest + 1,
            }
            for number, proposal in enumerate(proposals, 1)
        ],
        "left_over": proposals.left_over.tolist(),
    }


def _text(data: dict[str, Any], alone: str) -> str:
    lines = [f"{counted(n, 'movement')} joined {printable(name)}" for name, n in data["joined"].items()]
    lines += [f"{counted(n, 'movement')} would join {printable(name)}" for name, n in data["would_join"].items()]
    proposals = data["proposals"]
    rows = [
        (str(proposal["number"]), str(len(proposal["movements"])), f"{proposal['stability']:.2f}",
         f"{proposal['cohesion']:.2f}", "" if proposal["nearest"] is None else str(proposal["nearest"]),
         printable(proposal["name"] or ""))
        for proposal in proposals
    ]  # fmt: skip
    heads: tuple[str, ...] = ("number", "movements", "stability", "cohesion", "most like", "proposed name")
    n_columns = len(heads) if any(proposal["name"] for proposal in proposals) else len(heads) - 1
    title = f"{counted(len(proposals), 'proposal')}, {counted(len(data['left_over']), 'movement')} left over{alone}"
    if data.get("remaining"):
        title += "; the proposals that remain have new numbers, also in the pictures"
    if not (lines or rows or data["left_over"]):
        title = "no unlabeled movements"
    lines.append(table(heads[:n_columns], [row[:n_columns] for row in rows], title) if rows else title)
    if data["pictures"]:
        lines.append(f"pictures: {printable(data['pictures'][0])}")
    if rows and "version" in data and (data.get("remaining") or not (data["accepted"] or data["rejected"])):
        lines.append(f"accept what is listed here: the same command with --accept all --at {data['version']}")
    lines += [f"{printable(name)}: {counted(n, 'movement')}" for name, n in data.get("accepted", {}).items()]
    if data.get("rejected"):
        lines.append(f"rejected {', '.join(map(str, data['rejected']))}")
    return "\n".join(lines)


class Item(NamedTuple):
    """A proposal in the queue; its members are ids of movements."""

    title: str
    proposal: Any
    picture: Path | None


class Session:
    """Ask about each proposal and commit every answer at once; there is one picture for each."""

    def __init__(self, library: Any, proposals: Any, pictures: list[Path]) -> None:
        self.library = library
        self.items = deque(Item(str(k + 1), proposals[k], pictures[k]) for k in range(len(proposals)))

    def run(self) -> None:
        """Run until the queue is empty, the user enters /quit, or the input ends."""
        if self.items:
            write("Give each a name; /help says what else there is.")
        while self.items:
            item = self.items[0]
            size, stability = counted(len(item.proposal), "movement"), item.proposal.stability
            where = f"; see {printable(item.picture)}" if item.picture else ""
            suggestion = f"; /yes for {printable(item.proposal.name)}" if item.proposal.name else ""
            write(f"\n{item.title}: {size}, stability {stability:.2f}{where}{suggestion}")
            try:
                line = ask("name")
            except click.Abort:
                write()
                break
            try:
                if not self._answer(item, line):
                    break
            except KinemeError as error:
                write(f"  {printable(error)}")
        left = len(self.library.unlabeled())
        write(f"{counted(len(self.library.symbols()), 'symbol')}, {counted(left, 'movement')} without one")

    def _answer(self, item: Item, line: str) -> bool:
        """Carry out one line of input; return whether to continue."""
        command, _, rest = line.partition(" ")
        if command in {"/quit", "/q"}:
            return False
        if command == "/help":
            write(HELP)
        elif command == "/members":
            names = self.library.movements(ids=item.proposal.members).names or ()
            for key, name in zip(item.proposal.members.tolist(), names, strict=False):
                write(f"  {key}  {printable(name or '')}")
        elif command == "/split":
            parts = self.library.propose(item.proposal.members, n_clusters=2, min_members=2)
            if len(parts) < 2:
                write("  no two clusters of two movements or more in it")
            else:
                self.items.popleft()
                halves = (Item(f"{item.title}{'ab'[k]}", parts[k], None) for k in range(len(parts)))
                self.items.extendleft(reversed(list(halves)))
        elif command == "/reject":
            self.library.reject(item.proposal)
            self.items.popleft()
        elif command == "/name" or (command == "/yes" and item.proposal.name):
            self._accept(item, rest if command == "/name" else item.proposal.name)
        elif command.startswith("/"):
            write(f"  expected a name or one of {COMMANDS}, got {printable(command)}")
        elif line:
            self._accept(item, line)
        else:
            self.items.popleft()
        return True

    def _accept(self, item: Item, name: str) -> None:
        if name in self.library and not confirm(f"  join {printable(name)}, which exists?", default=True):
            return
        self.library.accept(item.proposal, name)
        self.items.popleft()
        symbol = self.library[name]
        write(f"  {printable(symbol.name)}: {counted(len(symbol), 'movement')} ({symbol.id})")
