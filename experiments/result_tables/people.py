"""Tables and sentences on people, beginnings and recordings in the pages about recognition, from the results."""

from __future__ import annotations

from typing import Any

from result_tables.measured import figures, rows

SHARES = ("25 %", "50 %", "75 %", "90 %", "100 %", "predict")
#: Set of movements in the results -> how the page says it.
DECIDED = {
    "digits by others": "digits in space, shown by four other people",
    "digits by the same person": "by the same person",
    "LASA": "13 shapes of LASA",
    "letters": "17 letters",
}
EARLIER = {
    "digits": "digits",
    "solids": "solids",
    "twenty kinds": "digits and solids together",
    "strokes2d": "single strokes, at three speeds",
    "multistrokes2d": "symbols of several strokes",
    "exercises6d": "exercises, a sensor at the wrist",
}
SPOTTED = ("with rests", "without", "with rests, among unknown", "without, among unknown", "with rests, noise 3 %")


def tables() -> dict[str, dict[str, str]]:
    """Page of the guide -> name of each table or sentence -> its text."""
    return {
        "recognition-defaults": {"vertical": _vertical(), "classifiers": _classifiers()},
        "early-and-live": {
            "earliness": _earliness(),
            "beginnings": _beginnings(),
            "halves": _halves(),
            "earlier": _earlier(),
            "decided": _decided(),
            "sure": _sure(),
        },
        "spotting": {"spotting": _spotting()},
    }


def _by_details(name: str, *keys: str) -> dict[tuple[str, ...], float]:
    """Values of some details -> what was measured."""
    found = (row for row in rows(name) if all(key in row["details"] for key in keys))
    return {tuple(str(row["details"][key]) for key in keys): row["ours"] for row in found}


def _vertical() -> str:
    found = figures("by_others")

    def pair(turned: str, shots: int) -> str:
        given, without = (
            found[f"{turned}, {known}, {shots} by others"] for known in ("vertical given", "vertical not given")
        )
        return f"{given:.2f} and {without:.2f}"

    turned = "turned about the vertical"
    return (
        "Twenty gestures in space, templates by four other people, one of each class, the vertical given and not:\n"
        f"{pair('as recorded', 1)} as recorded, {pair(turned, 1)} turned about the vertical by any angle;\n"
        f"four of each: {pair('as recorded', 4)}, and {pair(turned, 4)} (`python -m bench --only by_others`)."
    )


def _classifiers() -> str:
    found = figures("by_others")
    shots = sorted({int(what.split(", ")[1].split()[0]) for what in found if what.startswith("svm")})
    ahead = [found[f"nearest-each, {n} by others"] - found[f"nearest, {n} by others"] for n in shots]
    svm = [found[f"svm, {n} by others"] - found[f"nearest-each, {n} by others"] for n in shots]
    return (
        f"On the gestures by other people, with {shots[0]} to {shots[-1]} demonstrations of each class, the nearest "
        f"of each representation is\n{_between(ahead)} ahead of the nearest of all, and a support vector machine "
        f"on the same kernel {_between([-x for x in svm])} behind it\n(`python -m bench --only by_others`)."
    )


def _between(values: list[float]) -> str:
    return f"{min(values):.3f} to {max(values):.3f}"


def _earliness() -> str:
    found = figures("early")
    after = ", ".join(f"{found[f'LASA, {share} %']:.3f} after {share} %" for share in (20, 40, 50, 70))
    return (
        "On LASA, three demonstrations of each of 26 shapes, ten splits, with position, size and direction within 30°\n"
        f"unknown, the class is right for {after},\nand {found['LASA, 100 %']:.3f} on the whole path."
    )


def _beginnings() -> str:
    found = _by_details("early", "name", "shots", "where")
    heads = ("25 % of the path", "50 %", "75 %", "90 %", "whole", "`predict`")
    lines = [f"| | demonstrations of each | {' | '.join(heads)} |", "|---" * (len(heads) + 2) + "|"]
    for name in ("digits", "solids"):
        for shots in ("3", "8", "all"):
            values = " | ".join(f"{found[name, shots, where]:.2f}" for where in SHARES)
            lines.append(f"| {name} | {'all 40' if shots == 'all' else shots} | {values} |")
    return "\n".join(lines)


def _halves() -> str:
    found = _by_details("early", "name", "shots", "where")
    known = [found["digits", shots, "halves"] for shots in ("3", "all")]
    unknown = [found["digits", shots, "50 %"] for shots in ("3", "all")]
    return (
        "How much of a movement is done is not known. If it were, the whole recognizer, trained on halves, would name\n"
        f"{known[0]:.2f} of the halves of digits with three demonstrations and {known[1]:.2f} with all 40, instead of "
        f"{unknown[0]:.2f} and {unknown[1]:.2f}."
    )


def _earlier() -> str:
    found = _by_details("early", "name", "earlier")
    lines = [
        "| halves of | a new stream | after earlier movements | in the second half of the stream |",
        "|---" * 4 + "|",
    ]
    for name, said in EARLIER.items():
        values = " | ".join(f"{found[name, when]:.2f}" for when in ("alone", "after earlier", "second half"))
        lines.append(f"| {said} | {values} |")
    return "\n".join(lines)


def _decided() -> str:
    found = _by_details("early", "name", "figure")
    lines = ["| | decided early | right | after (median) | other movements decided |", "|---" * 5 + "|"]
    for k, (name, said) in enumerate(DECIDED.items()):
        values = [f"{found[name, what]:.2f}" for what in ("decided", "right", "after", "others decided")]
        values[2] += " of the time" if k == 0 else ""
        lines.append(f"| {said} | {' | '.join(values)} |")
    return "\n".join(lines)


def _sure() -> str:
    found = _by_details("early", "name", "figure")
    share = {name: f"{100 * found[name, 'others at the end']:.0f} %" for name in DECIDED}
    return (
        f"At their last sample, {share['digits by others']} of the solids, {share['LASA']} of the shapes and "
        f"{share['letters']} of the letters still have a class\nat 0.9: where such movements occur, ask `finish()` "
        "before you act."
    )


def _spotting() -> str:
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for row in rows("spotting"):
        what = row["what"].rpartition(", ")[2]
        found.setdefault(row["details"]["who"], {}).setdefault(row["details"]["how"], {})[what] = row["ours"]
    lines = [f"| | {' | '.join(SPOTTED)} |", "|---" * (len(SPOTTED) + 1) + "|"]
    for who, hows in found.items():
        cells = [
            " / ".join(_short(hows[how][what]) for what in ("precision", "recall")) if how in hows else "-"
            for how in SPOTTED
        ]
        lines.append(f"| {who} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _short(value: float) -> str:
    return f"{value:.2f}".removeprefix("0")
