"""Pages about the routes of the studio, from the description of its interface in OpenAPI."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

from extensions.tables import bounds, kind, table

_LINK = "[{0}](#json-{0})"
_REFERENCE = re.compile(r"#/components/schemas/(\w+)")
_ABOUT = """
What a program asks of `kineme studio`, by HTTP. How to find the token, and an example:
[Samples from a program](../../guide/studio-network.md#samples-from-a-program). A studio that runs describes itself as
OpenAPI, for programs that make clients from that: `GET /api/openapi.json`.
"""


def pages() -> Iterator[tuple[str, str]]:
    """File name and text of each page, in Markdown: one of all routes, and one for each group of them."""
    described = description()
    tags = {tag: f"routes-{tag}" for tag in dict.fromkeys(one["tags"][0] for _, _, one in _routes(described))}
    yield "routes.md", "\n".join(_page(described, tags))
    left = dict(sorted(described["components"]["schemas"].items()))
    for tag, file in tags.items():
        routes = [route for route in _routes(described) if route[2]["tags"][0] == tag]
        used = [name for name in _used(routes, described["components"]["schemas"]) if name in left]
        schemas = {name: left.pop(name) for name in sorted(used)}
        yield f"{file}.md", "\n".join(_group(tag, routes, schemas))
    if left:
        raise ValueError(f"expected a route for every object, found none for {', '.join(left)}")


def description() -> dict[str, Any]:
    """The interface as OpenAPI; no library is opened."""
    from kineme.studio.server.app import ABOUT, REFUSALS, ROUTERS, StudioApp

    app = StudioApp(title="kineme studio", description=ABOUT, responses=REFUSALS)
    for router in ROUTERS:
        app.include_router(router)
    return app.openapi()


def _routes(described: dict[str, Any]) -> list[tuple[str, str, dict[str, Any]]]:
    return [(way.upper(), path, one) for path, ways in described["paths"].items() for way, one in ways.items()]


def _used(routes: Any, schemas: dict[str, Any]) -> list[str]:
    """Names of the objects that are sent or answered, and of those within them."""
    used: dict[str, None] = {}
    waiting = [json.dumps(routes)]
    while waiting:
        for name in _REFERENCE.findall(waiting.pop()):
            if name not in used:
                used[name] = None
                waiting.append(json.dumps(schemas[name]))
    return list(used)


def _page(described: dict[str, Any], tags: dict[str, str]) -> Iterator[str]:
    routes = _routes(described)
    yield f"# Routes of the studio\n{_ABOUT}\n{described['info']['description'].partition(chr(10) * 2)[2]}"
    yield from table(("route", "what it does"), [(_to(way, path), one["summary"]) for way, path, one in routes])
    refusals = routes[0][2]["responses"]["4XX"]["description"]
    yield f"\nEvery refusal is a {_LINK.format('Refusal')} with one of these: {refusals}"
    yield "\n```{toctree}\n:hidden:\n"
    yield from tags.values()
    yield "```\n"


def _group(tag: str, routes: list[tuple[str, str, dict[str, Any]]], schemas: dict[str, Any]) -> Iterator[str]:
    yield f"# Routes of the studio: {tag}\n"
    for way, path, one in routes:
        yield from _route(way, path, one)
    if schemas:
        yield "\n## What is sent and answered\n\nObjects of JSON, by their names in the description."
    for name, schema in schemas.items():
        yield from _schema(name, schema)


def _to(way: str, path: str) -> str:
    return f"[{way} {path}](#{_place(way, path)})"


def _place(way: str, path: str) -> str:
    return "-".join([way.lower(), *path.strip("/").replace("{", "").replace("}", "").split("/")])


def _route(way: str, path: str, one: dict[str, Any]) -> Iterator[str]:
    yield f"\n({_place(way, path)})=\n## {way} {path}\n\n**{one['summary']}.** {one.get('description', '')}\n"
    asked = [
        (f"`{name['name']}`", name["in"], _kind(name["schema"]), name.get("description", ""))
        for name in one.get("parameters", [])
    ]
    if asked:
        yield from table(("parameter", "where", "kind", "what it is"), asked)
        yield ""
    if "requestBody" in one:
        yield f"Takes {_content(one['requestBody'])}."
    yield f"Answers {_content(one['responses']['200'])}."


def _content(body: dict[str, Any]) -> str:
    return " or ".join(
        kind(content["schema"], _LINK) if content.get("schema") else "bytes" for content in body["content"].values()
    )


def _kind(schema: dict[str, Any]) -> str:
    return "; ".join(filter(None, [kind(schema, _LINK), bounds(schema)]))


def _schema(name: str, schema: dict[str, Any]) -> Iterator[str]:
    yield f"\n(json-{name})=\n### {name}\n\n{schema.get('description', '')}\n"
    needed = schema.get("required", [])
    rows = [
        (f"`{key}`{'' if key in needed else ' (optional)'}", _kind(one), one.get("description", ""))
        for key, one in schema.get("properties", {}).items()
    ]
    yield from table(("key", "kind", "what it is"), [tuple(cell.replace("|", r"\|") for cell in row) for row in rows])
