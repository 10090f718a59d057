"""Tables of docs/beside-others.md, docs/migrating and a tutorial, from the results and docs/features.toml."""

from __future__ import annotations

import json
import re
from typing import Any

import feature_table
import million_tables
from make_tables import DOCS, METHODS, OURS, PERTURBED, RESULTS, SHOWN

#: Rows of the speed table: file of results, what was measured there, what it is called on the page.
SPEED = (
    ("learn_even", "learn 10,000 even movements", "movements learned, evenly sampled"),
    ("learn_ragged", "learn 10,000 ragged movements", "movements learned, unequal and uneven"),
    ("learn_even", "generate 10,000 even movements", "movements generated"),
    ("control", "step, 7 dimensions", "one live step, 7 dimensions"),
    ("control", "step, 3 dimensions, 1 obstacle", "one live step around an obstacle, in space"),
    ("recognize", "fit and predict in the plane, 26 classes, 10,000 ragged movements", "movements named, in the plane"),
    ("recognize", "fit and predict in space, 26 classes, 10,000 ragged movements", "movements named, in space"),
    ("gram", "TrE, float64, 4000 x 4000", "truncated Euclidean kernel, float64"),
    ("gram", "RBF, float64, 4000 x 4000", "RBF kernel, float64"),
    ("bags", "ROS 2 in MCAP, 1,009 MB, states of 14 joints", "a bag of ROS 2 read, beside its bare messages"),
    ("lerobot", "  read", "frames of LeRobot read, beside their bare columns"),
    ("startup", "import kineme", "import, beside the import of NumPy"),
)
N_BASIS = (10, 20, 40, 80)
Asked = list[tuple[str, str, str, str]]


def tables() -> dict[str, dict[str, str]]:
    """Page -> name of each table or sentence -> its text."""
    shapes, people = _protocols("lasa"), _protocols("gestures3d")
    one = [(f"one shot, {name}", "robustness", name, "accuracy") for name in PERTURBED]
    one += [(f"{n} shots", "few-shot", f"{n} shots", "accuracy") for n in (3, 5)]
    turned = [("one shot, rotation by any angle", "any-angle", "any angle", "accuracy")]
    others = [(f"by others, {name}", "user-independent", name, "accuracy") for name in people["user-independent"][OURS]]
    oneself = [(f"by oneself, {name}", "user-dependent", name, "accuracy") for name in people["user-dependent"][OURS]]
    measures = {"auroc": "AUROC, known against unknown", "rejected": "unknown rejected at 5 % false rejection"}
    unknown = [(text, "open-set", "perturbed", measure) for measure, text in measures.items()]
    asked = {"shapes": (shapes, one + turned), "people": (people, others + oneself), "unknown": (shapes, unknown)}
    beside = {name: table(*what) for name, what in asked.items()}
    beside |= {f"{name} said": who_leads(*what) for name, what in asked.items()}
    beside |= {
        "speed": _speed(),
        "repeated": _repeated(),
        "repeated said": _repeated_said(),
        "conditions": _conditions(),
        "features": feature_table.table(),
        "features found": feature_table.sources(),
    }
    return {"beside-others.md": beside, "tutorials/a-million-movements.md": million_tables.tables()} | {
        f"migrating/{row['details']['page']}.md": {row["details"]["page"]: _migrated(row)} for row in _rows("migrating")
    }


def filled(page: str, texts: dict[str, str]) -> str:
    """The page with every text between its marks; `KeyError` names one that the page has no place for."""
    for name, text in texts.items():
        marks = re.compile(rf"(<!-- table: {re.escape(name)} -->\n).*?(<!-- end -->)", re.DOTALL)
        if not marks.search(page):
            raise KeyError(name)
        page = marks.sub(lambda found, text=text: f"{found[1]}{text}\n{found[2]}", page)
    return page


def table(protocols: dict[str, Any], rows: Asked) -> str:
    """A line for each of `rows`, (text, protocol, condition, measure); a column for each method, the best in bold."""
    methods = [name for name in SHOWN if any(name in by_method for by_method in protocols.values())]
    lines = [f"| | {' | '.join(METHODS[name].title for name in methods)} |", "|---" * (len(methods) + 1) + "|"]
    for text, *what in rows:
        values = _values(protocols, what)
        best = max(values.values())
        cells = [_cell(values[name], best) if name in values else "-" for name in methods]
        lines.append(f"| {text} | {' | '.join(cells)} |")
    return "\n".join(lines)


def who_leads(protocols: dict[str, Any], rows: Asked) -> str:
    """In how many of the rows kineme is ahead, to three digits, and who is ahead of it elsewhere."""
    ahead, level, behind = 0, 0, []
    for text, *what in rows:
        values = _values(protocols, what)
        ours, best = values.pop(OURS), max(values.values())
        ahead, level = ahead + (ours > best), level + (ours == best)
        if ours < best:
            who = " and ".join(METHODS[name].title for name, value in values.items() if value == best)
            behind.append(f"{who} in *{text}* ({best:.3f} against {ours:.3f})")
    said = f"To three digits, kineme is ahead of all others in {_of(ahead, len(rows))}"
    said += f" and level with the best in {level}." if level else "."
    return f"{said} Ahead of it: {'; '.join(behind)}." if behind else said


def _of(n: int, total: int) -> str:
    return f"all {total} rows" if n == total else f"{n} of these {total} rows"


def _values(protocols: dict[str, Any], what: list[str]) -> dict[str, float]:
    protocol, condition, measure = what
    found = {name: by.get(condition, {}).get(measure, {}).get("mean") for name, by in protocols[protocol].items()}
    return {name: round(value, 3) for name, value in found.items() if value is not None and name in SHOWN}


def _cell(value: float, best: float) -> str:
    return f"**{value:.3f}**" if value == best else f"{value:.3f}"


def _speed() -> str:
    lines = ["| | kineme | the other | | ours is |", "|---|---|---|---|---|"]
    for name, what, text in SPEED:
        row = next(row for row in _rows(name) if row["what"] == what and row["peer"] is not None)
        ours, peer, faster = _figure(row["ours"]), _figure(row["peer"]), _times(row)
        lines.append(f"| {text} | {ours} {row['unit']} | {peer} {row['unit']} | {row['peer_name']} | {faster} |")
    return "\n".join(lines)


def _times(row: dict[str, Any]) -> str:
    """How many times faster ours is, whether the unit is a time or a rate."""
    times = row["ours"] / row["peer"] if row["unit"].endswith("/s") else row["peer"] / row["ours"]
    return f"{_figure(times)} times as fast" if times >= 1 else f"{_figure(1 / times)} times slower"


def _figure(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def _repeated() -> str:
    lines = ["| basis functions | kineme, median (largest) | movement_primitives | pydmps |", "|---|---|---|---|"]
    for n in N_BASIS:
        ours, others = _errors(n)
        lines.append(f"| {n} | {_error(ours)} | {_error(others['movement_primitives'])} | {_error(others['pydmps'])} |")
    return "\n".join(lines)


def _repeated_said() -> str:
    parts = []
    for name in ("movement_primitives", "pydmps"):
        closer = [n for n in N_BASIS if _errors(n)[0]["median"] < _errors(n)[1][name]["median"]]
        parts.append(f"than {name} in {_of(len(closer), len(N_BASIS))}")
    return f"By the median, kineme repeats the movement more closely {' and '.join(parts)}."


def _errors(n: int) -> tuple[dict[str, float], dict[str, dict[str, float]]]:
    """Median and largest error of our fit of the path in the original formulation, and of each peer."""
    ours: dict[str, float] = {}
    others: dict[str, dict[str, float]] = {}
    for row in _rows("reconstruction"):
        for kind in ("median", "max"):
            if row["what"] == f"N = {n}, original, trajectory, {kind}":
                ours[kind] = row["ours"]
                others.setdefault(row["peer_name"], {})[kind] = row["peer"]
    return ours, others


def _error(values: dict[str, float]) -> str:
    return f"{_figure(values['median'])} % ({_figure(values['max'])} %)"


def _migrated(row: dict[str, Any]) -> str:
    versions = json.loads((RESULTS / "migrating.json").read_text(encoding="utf-8"))["versions"]
    peer = {"movement_primitives": "movement-primitives", "dollar": "dollarpy"}.get(row["details"]["page"], "pydmps")
    measured = row["what"].partition(": ")[2]
    return f"Measured with {peer} {versions[peer]}: {measured}, {row['ours']:.3g} {row['unit']}."


def _conditions() -> str:
    """Machine and versions with which the speed was measured."""
    content = json.loads((RESULTS / "learn_even.json").read_text(encoding="utf-8"))
    named = ", ".join(
        f"{name} {version}" for name, version in content["versions"].items() if version != "not installed"
    )
    return f"{content['machine']['cores']} cores, {content['machine']['system']}; {named}."


def _protocols(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((RESULTS / f"evaluation-{name}.json").read_text(encoding="utf-8"))["protocols"]
    return found


def _rows(name: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))["rows"]
    return found


def fill_pages() -> None:
    """Write all texts into the pages."""
    for page, texts in tables().items():
        path = DOCS / page
        path.write_text(filled(path.read_text(encoding="utf-8"), texts), encoding="utf-8")
        print(path)
