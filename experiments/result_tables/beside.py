"""Tables of docs/beside-others.md, docs/migrating and a tutorial, from the results and docs/features.toml."""

from __future__ import annotations

from typing import Any

from kineme_experiments.evaluation.methods import METHODS, OURS
from result_tables import features as feature_table
from result_tables import million as million_tables
from result_tables.measured import Asked, content, means, protocols, rows, table

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
#: Conditions of the robustness protocol that the pages show.
PERTURBED = (
    "as recorded", "shift 2 extents", "scale 2^±1", "rotation ±20°", "rotation ±40°", "warp 0.35", "noise 3 %",
    "all moderately", "all strongly",
)  # fmt: skip


def tables() -> dict[str, dict[str, str]]:
    """Page -> name of each table or sentence -> its text."""
    asked = evaluated()
    beside = {name: table(*what) for name, what in asked.items()}
    beside |= {f"{name} said": who_leads(*what[1:]) for name, what in asked.items()}
    beside |= {
        "speed": _speed(),
        "repeated": _repeated(),
        "repeated said": _repeated_said(),
        "conditions": _conditions(),
        "features": feature_table.table(),
        "features found": feature_table.sources(),
    }
    return {"beside-others.md": beside, "tutorials/a-million-movements.md": million_tables.tables()} | {
        f"migrating/{row['details']['page']}.md": {row["details"]["page"]: _migrated(row)} for row in rows("migrating")
    }


def evaluated() -> dict[str, tuple[str, dict[str, Any], Asked]]:
    """Table of recognition -> the head of its first column, where its values are from, and its rows."""
    shapes, people = protocols("lasa"), protocols("gestures3d")
    drawn = [(f"one shot, {name}", "robustness", name, "accuracy") for name in PERTURBED]
    drawn += [("one shot, rotation by any angle, `max_angle=pi`", "any-angle", "any angle", "accuracy")]
    drawn += [(f"{n} shots", "few-shot", f"{n} shots", "accuracy") for n in (3, 5)]
    shown = [
        (f"{text}, {name}", protocol, name, "accuracy")
        for protocol, text in (("user-independent", "by others"), ("user-dependent", "by oneself"))
        for name in people[protocol][OURS]
    ]
    measures = {
        "auroc": "AUROC, known against unknown",
        "rejected": "unknown rejected at 5 % false rejection",
        "accuracy": "known accepted and named right",
    }
    unknown = [(text, "open-set", "perturbed", measure) for measure, text in measures.items()]
    return {
        "shapes": ("accuracy", shapes, drawn),
        "people": ("accuracy", people, shown),
        "unknown": ("open set", shapes, unknown),
    }


def who_leads(found: dict[str, Any], asked: Asked) -> str:
    """In how many of the rows kineme is ahead, to three digits, and who is ahead of it elsewhere."""
    ahead, level, behind = 0, 0, []
    for text, *what in asked:
        values = means(found, *what)
        ours, best = values.pop(OURS), max(values.values())
        ahead, level = ahead + (ours > best), level + (ours == best)
        if ours < best:
            who = " and ".join(METHODS[name].title for name, value in values.items() if value == best)
            behind.append(f"{who} in *{text}* ({best:.3f} against {ours:.3f})")
    said = f"To three digits, kineme is ahead of all others in {_of(ahead, len(asked))}"
    said += f" and level with the best in {level}." if level else "."
    return f"{said} Ahead of it: {'; '.join(behind)}." if behind else said


def _of(n: int, total: int) -> str:
    return f"all {total} rows" if n == total else f"{n} of these {total} rows"


def _speed() -> str:
    lines = ["| | kineme | the other | | ours is |", "|---|---|---|---|---|"]
    for name, what, text in SPEED:
        row = next(row for row in rows(name) if row["what"] == what and row["peer"] is not None)
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
    for row in rows("reconstruction"):
        for kind in ("median", "max"):
            if row["what"] == f"N = {n}, original, trajectory, {kind}":
                ours[kind] = row["ours"]
                others.setdefault(row["peer_name"], {})[kind] = row["peer"]
    return ours, others


def _error(values: dict[str, float]) -> str:
    return f"{_figure(values['median'])} % ({_figure(values['max'])} %)"


def _migrated(row: dict[str, Any]) -> str:
    versions = content("migrating")["versions"]
    named = {"movement_primitives": "movement-primitives", "dollar": "dollarpy", "mp_pytorch": "mp-pytorch"}
    peer = named.get(row["details"]["page"], "pydmps")
    measured = row["what"].partition(": ")[2]
    return f"Measured with {peer} {versions[peer]}: {measured}, {row['ours']:.3g} {row['unit']}."


def _conditions() -> str:
    """Machine and versions with which the speed was measured."""
    found = content("learn_even")
    named = ", ".join(f"{name} {version}" for name, version in found["versions"].items() if version != "not installed")
    return f"{found['machine']['cores']} cores, {found['machine']['system']}; {named}."
