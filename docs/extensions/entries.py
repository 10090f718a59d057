"""Entries of the index, which the search reads: those of error messages; all are kept for the next build."""

from __future__ import annotations

from typing import TYPE_CHECKING

from docutils import nodes
from sphinx import addnodes
from sphinx.util.index_entries import split_index_msg

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.environment import BuildEnvironment


def add_messages(app: Sphinx, doctree: nodes.document) -> None:
    """Give each message of the page of messages a place and an entry, so that the search leads to the message."""
    if app.env.docname != "reference/generated/messages":
        return
    for k, item in enumerate(doctree.findall(nodes.list_item)):
        item["ids"].append(f"message-{k}")
        text = item.astext().replace(";", ",")
        item.insert(0, addnodes.index(entries=[("single", text, item["ids"][0], "", None)]))


def forget(app: Sphinx, env: BuildEnvironment, page: str) -> None:
    """Forget the entries of a page that is read again."""
    env._search_index_index_entries.pop(page, None)


def keep(app: Sphinx, env: BuildEnvironment) -> None:
    """Keep the entries of all pages; Sphinx itself forgets those of pages that another build wrote."""
    held = env._search_index_index_entries
    for page in env.found_docs - set(held):
        found = [one for node in env.get_doctree(page).findall(addnodes.index) for one in node["entries"]]
        held[page] = sorted(
            {(text, place, main) for kind, line, place, main, _ in found for text in split_index_msg(kind, line)}
        )
