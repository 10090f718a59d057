"""What the search reads beside words: error messages, and entries of the index, which are kept for the next build."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from docutils import nodes
from sphinx import addnodes
from sphinx.util.index_entries import split_index_msg

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.environment import BuildEnvironment

_MESSAGES = "reference/generated/messages-"


def place_messages(app: Sphinx, doctree: nodes.document) -> None:
    """Give each message of a page of messages a place, to which the search leads."""
    if app.env.docname.startswith(_MESSAGES):
        for k, item in enumerate(doctree.findall(nodes.list_item)):
            item["ids"].append(f"message-{k}")


def add_messages(app: Sphinx) -> list[tuple[str, dict[str, Any], str]]:
    """Put the messages among the titles that the search reads: Sphinx writes entries of the index in lower case."""
    indexer = getattr(app.builder, "indexer", None)
    pages = [page for page in app.env.found_docs if page.startswith(_MESSAGES)] if indexer is not None else []
    for page in pages:
        titles = [one for one in indexer._all_titles.get(page, ()) if not str(one[1]).startswith("message-")]
        items = app.env.get_doctree(page).findall(nodes.list_item)
        indexer._all_titles[page] = [
            *titles,
            *((" ".join(item.astext().split()), item["ids"][0]) for item in items),
        ]
    return []  # no page of its own


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
