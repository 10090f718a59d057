"""Links: names of code in all pages lead to the reference, from whatever they were written as."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from docutils import nodes
from sphinx import addnodes
from sphinx.transforms.post_transforms import SphinxPostTransform

from extensions.public import PUBLIC

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.environment import BuildEnvironment


class NamesInDocstrings(SphinxPostTransform):
    """Kinds of parameters and errors in the reference lead to the public name that they are, or nowhere.

    Sphinx itself would take ``labels`` for whatever class has a member of that name.
    """

    default_priority = 5  # before Sphinx looks for them

    def run(self, **options: Any) -> None:
        """Replace what waits to be resolved."""
        if not self.env.docname.startswith("reference/generated/"):
            return
        for waiting in list(self.document.findall(addnodes.pending_xref)):
            if waiting.get("refdomain") == "py" and waiting.get("reftype") in {"class", "obj", "exc"}:
                uri = address(self.app, self.env, waiting["reftarget"])
                text = [child.deepcopy() for child in waiting.children]
                found = [nodes.reference("", "", *text, refuri=uri, internal=True)] if uri else text
                waiting.parent.replace(waiting, found)


class NamesInText(SphinxPostTransform):
    """Code in a sentence that is a public name, as ``kineme.DMP`` or ``Recognizer``, becomes a link to its page."""

    default_priority = 400

    def run(self, **options: Any) -> None:
        """Put the links around the names, once each in a section."""
        for literal in list(self.document.findall(nodes.literal)):
            uri = None if _is_link(literal) else address(self.app, self.env, literal.astext())
            if uri is not None and _says_enough(literal.astext()):
                literal.replace_self(nodes.reference("", "", literal.deepcopy(), refuri=uri, internal=True))


def address(app: Sphinx, env: BuildEnvironment, written: str) -> str | None:
    """Where a public name or a member of one is explained, from the page that is read; None of others and of itself."""
    name = written.partition("(")[0]
    inside, _, member = name.rpartition(".")
    if name in PUBLIC:
        target, place = PUBLIC[name], ""
    elif inside in PUBLIC and f"{PUBLIC[inside]}.{member}" in env.domains.python_domain.objects:
        target, place = PUBLIC[inside], f"#{PUBLIC[inside]}.{member}"
    else:
        return None
    document = f"reference/generated/{target}"
    if document not in env.all_docs or (document == env.docname and not place):
        return None
    return app.builder.get_relative_uri(env.docname, document) + place if document != env.docname else place


def _says_enough(text: str) -> bool:
    """Whether it is a name for certain; ``join`` and ``blend`` may be anything."""
    return "." in text or not text.islower() or text.endswith("()") or "_" in text


def _is_link(node: nodes.Node) -> bool:
    while node.parent is not None:
        node = node.parent
        if isinstance(node, (nodes.reference, nodes.title, addnodes.pending_xref)):
            return True
    return False
