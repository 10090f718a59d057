"""For screen readers: what Sphinx and the theme leave out of the pages that they write."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_ARROW = re.compile(r'(<a [^>]*>([^<"]*)</a>\s*<details[^>]*>\s*<summary)>')
_PARAMETERS = '<dl>\n<dd><em class="sig-param">'  # a list of definitions without what they define


def mend_page(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: object) -> None:
    """Give names to the arrows that open a part of the navigation; long signatures are no definitions."""
    if "body" in context:
        context["body"] = context["body"].replace(_PARAMETERS, _PARAMETERS.replace("<dl>", '<dl role="presentation">'))
    if "generate_toctree_html" in context:
        context["generate_toctree_html"] = _named(context["generate_toctree_html"])


def _named(navigation: Callable[..., Any]) -> Callable[..., Any]:
    def with_names(*arguments: Any, **options: Any) -> Any:
        tree = navigation(*arguments, **options)
        return _ARROW.sub(r'\1 aria-label="Pages below \2">', str(tree)) if arguments[:1] == ("sidebar",) else tree

    return with_names
