"""The dialogue of ``kineme anchor``: one proposal after another, until all are named or the user stops."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import Any, NamedTuple

import click

from kineme.cli.output import ask, confirm, write
from kineme.errors import KinemeError
from kineme.output.text import counted, printable

HELP = """\
  a name         makes it a symbol, or joins the symbol of that name
  (nothing)      leaves it for later
  /split         looks for two clusters in it
  /reject        leaves its movements unnamed, and does not propose it again
  /members       lists its movements
  /name TEXT     a name that begins with a slash
  /quit          stops; what is named stays"""


class Item(NamedTuple):
    """A proposal in the queue; its members are ids of movements."""

    title: str
    proposal: Any
    picture: Path | None


class Session:
    """Ask about each proposal and commit every answer at once.

    Parameters
    ----------
    library : ActionLibrary
        Opened for writing.
    proposals : LibraryProposals
    pictures : list of Path
        One per proposal.
    """

    def __init__(self, library: Any, proposals: Any, pictures: list[Path]) -> None:
        self.library = library
        self.items = deque(Item(str(k + 1), proposals[k], pictures[k]) for k in range(len(proposals)))

    def run(self) -> None:
        """Run until the queue is empty, the user enters /quit, or the input ends."""
        if self.items:
            write("Give each a name; /help says what else there is.")
        while self.items:
            item = self.items[0]
            write(self._summary(item))
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
            self._members(item)
        elif command == "/split":
            self._split(item)
        elif command == "/reject":
            self.library.reject(item.proposal)
            self.items.popleft()
        elif command == "/name":
            self._accept(item, rest)
        elif command.startswith("/"):
            write(f"  expected a name or one of /split, /reject, /members, /name, /quit, got {printable(command)}")
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

    def _split(self, item: Item) -> None:
        parts = self.library.propose(item.proposal.members, n_clusters=2, min_members=2)
        if len(parts) < 2:
            write("  no two clusters of two movements or more in it")
            return
        self.items.popleft()
        for k in reversed(range(len(parts))):
            self.items.appendleft(Item(f"{item.title}{'ab'[k]}", parts[k], None))

    def _members(self, item: Item) -> None:
        names = self.library.movements(ids=item.proposal.members).names or ()
        for key, name in zip(item.proposal.members.tolist(), names, strict=False):
            write(f"  {key}  {printable(name or '')}")

    def _summary(self, item: Item) -> str:
        one = item.proposal
        where = f"; see {printable(item.picture)}" if item.picture else ""
        return f"\n{item.title}: {counted(len(one), 'movement')}, stability {one.stability:.2f}{where}"
