"""What requests to change the library hold."""

from __future__ import annotations

from pydantic import Field

from kineme.studio.server.records import Change, Description, Ids, Name, Point, Text, Times


class NewMovement(Change):
    """A movement to be stored."""

    times: Times
    positions: list[Point]
    label: Name | None = Field(None, description="Name of its symbol, which is made if needed.")
    group: Name | None = Field(None, description="Who showed it.")


class Back(Change):
    """Which version's state is wanted again; by default that before the last change."""

    to: int | None = Field(None, ge=0)


class Rename(Change):
    """A new name of a symbol."""

    name: Name


class Describe(Change):
    """A description of a symbol."""

    text: Description


class Split(Change):
    """Members of a symbol that become a new one."""

    ids: Ids
    name: Name


class Merge(Change):
    """Symbols that become one."""

    ids: list[Text] = Field(min_length=1, max_length=10_000)
    into: Name


class Assign(Change):
    """Movements, and the symbol that they belong to from now on; none if null."""

    ids: Ids
    symbol: Name | None


class Chosen(Change):
    """Movements."""

    ids: Ids
