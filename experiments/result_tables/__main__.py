"""Write the tables of results into the pages, from the files of the benchmark and the evaluation: ``make tables``.

``python -m result_tables lasa=out/evaluation/evaluation.json`` (in experiments/) takes in the results of an evaluation
first.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from result_tables import adapting as adapting_tables
from result_tables import beside as beside_tables
from result_tables import concepts as concept_tables
from result_tables import exported, large_archives, motion_layer, planning
from result_tables import gpu as gpu_tables
from result_tables import modulation as modulation_tables
from result_tables import outliers as outlier_tables
from result_tables import people as people_tables
from result_tables import sensors as sensor_tables
from result_tables.measured import DOCS, RESULTS, figures, fill, rows, table

#: Pages of the guide with one table or a few.
GUIDES = (adapting_tables, gpu_tables, modulation_tables, outlier_tables, sensor_tables)
#: Default -> why, and the other values that were measured.
DEFAULTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "the defaults": ("", ("defaults",)),
    "seven representations": (
        "they fail on different movements; in an average of kernels one that succeeds suffices",
        (
            "positions over arc length alone", "f over time alone", "elastic path alone", "turning angles alone",
            "point cloud alone", "without positions over arc length", "without f over time", "without elastic path",
            "without turning angles", "without point cloud", "elastic path in detail alone",
            "point cloud in detail alone", "without elastic path in detail", "without point cloud in detail",
            "without detail", "with f over arc length",
        ),
    ),
    "weights 2, 1, 2, 1, 2, 6, 6": (
        "those that compare the whole shape count twice, in detail six times",
        ("equal weights", "detail at the weight of the others"),
    ),
    '`mean="arithmetic"`': (
        "one representation with a high similarity suffices", ("geometric", "harmonic", "min", "quadratic")
    ),
    "width 0.4 of the typical distance to the nearest movement of another class": (
        "a movement at that distance then has a similarity of exp(-3)", ("0.25 of it", "0.6 of it")
    ),
    "`cutoff=10`": (
        "deliberate movements of people have few cycles; faster changes are mostly sensor noise",
        ("5 cycles", "20 cycles", "not smoothed"),
    ),
    "k = 0.03 in the plane, 0.1 in space": (
        "people and cameras are tilted by 30° or so; a limit would refuse what lies beyond it",
        ("k = 0", "k = 0.01", "k = 0.1", "k = 0.3", "a limit of 0°", "a limit of 60°"),
    ),
    '`scale="path"`': (
        "the same gesture is made large and small; its proportions belong to it", ("per dimension", "size kept")
    ),
}  # fmt: skip


def recognition() -> dict[Path, dict[str, str]]:
    """Each page about recognition -> names of its tables and sentences -> their lines."""
    evaluated, people = beside_tables.evaluated(), people_tables.tables()
    measured = {
        "recognition-defaults": {"defaults": _defaults(), "many": _many(), "nested": _nested()},
        "recognition-beside-others": {
            "people": table(*evaluated["people"]),
            "lasa": table(*evaluated["shapes"]),
            "open-set": table(*evaluated["unknown"]),
            "strangers": _strangers(),
            "answers": _answers(),
        },
        "early-and-live": {"stream": _stream()},
    }
    return {
        DOCS / "guide" / f"{page}.md": measured.get(page, {}) | people.get(page, {}) for page in {**measured, **people}
    }


def _defaults() -> str:
    measured = figures("defaults")
    lines = ["| default | why | value | LASA, moderately / strongly | gestures by others |", "|---|---|---|---|---|"]
    for default, (why, names) in DEFAULTS.items():
        for k, name in enumerate(names):
            shapes = " / ".join(f"{measured[f'{name}, {level}']:.3f}" for level in ("moderately", "strongly"))
            first = f"| {default} | {why} |" if k == 0 else "| | |"
            lines.append(
                f"{first} {'' if name == 'defaults' else name} | {shapes} | {measured[f'{name}, by others']:.3f} |"
            )
    return "\n".join(lines)


def _many() -> str:
    measured = figures("defaults")
    names = [name.removeprefix("many shown: ") for name in measured if name.startswith("many shown")]
    lines = ["| twelve demonstrations of each shape, bent copies of four recordings | accuracy |", "|---|---|"]
    return "\n".join([*lines, *(f"| {name} | {measured[f'many shown: {name}']:.3f} |" for name in names)])


def _nested() -> str:
    lines = [
        "| set left out | weights | width | k, plane / space | band | accuracy | the defaults | best in hindsight |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows("nested"):
        (chosen, count), *others = row["details"]["chosen"]
        weights, k = ", ".join(map("{:g}".format, chosen["weights"])), " / ".join(map(str, chosen["concentrations"]))
        often = f" ({count} of {count + sum(other[1] for other in others)} people)" if others else ""
        best = row["details"]["best in hindsight"]["accuracy"]
        lines.append(
            f"| {row['what']} | {weights}{often} | {chosen['share']:g} | {k} | {chosen['band']} | {row['ours']:.3f} "
            f"| {row['peer']:.3f} | {best:.3f} |"
        )
    return "\n".join(lines)


def _strangers() -> str:
    """A line for each set and number of demonstrations, and a sentence on where a rival is ahead."""
    *measured, mean = rows("strangers")
    lines = [
        "| movements by others | kineme | best of the rivals | lead ± standard error |",
        "|---|---|---|---|",
    ]
    behind = []
    for row in measured:
        lead, error = row["details"]["lead"], row["details"]["standard_error"]
        lines.append(
            f"| {row['what']} | {row['ours']:.3f} | {row['peer']:.3f}, {row['peer_name']} | {lead:+.3f} ± {error:.3f} |"
        )
        if lead < -2 * error:
            behind.append(row["what"])
    clearly = "; ".join(behind) or "nowhere"
    sentence = (
        f"On average kineme is {mean['ours']:.3f} ahead of the best rival. Behind it by more than two standard errors: "
        f"{clearly} (`python -m bench --only strangers`)."
    )
    return "\n".join([*lines, "", sentence])


def _answers() -> str:
    """What a label, an answer, and one with its transform take, beside the rival of each set."""
    lines = ["| one movement | kineme [ms] | rival [ms] | times as fast |", "|---|---|---|---|"]
    lines += [
        f"| {row['what']} | {row['ours']:.1f} | {row['peer']:.1f}, {row['peer_name']} | {row['ratio']:.2f} |"
        for row in rows("answers")
    ]
    return "\n".join(lines)


def _stream() -> str:
    """What an update and the end of a live stream take, in words."""
    measured = figures("stream")

    def of(what: str, end: str, digits: int) -> str:
        pair = (f"{measured[what.format(n=n) + end]:.{digits}f}" for n in (100, 500))
        return " and ".join(pair)

    update, rate = "an update, {n} demonstrations in ", "rate that 99 of 100 updates hold, {n} demonstrations in "
    slowest = max(value for what, value in measured.items() if what.startswith("finish"))
    return (
        f"With 100 and with 500 demonstrations, an update takes {of(update, 'the plane, median', 1)} ms in the plane\n"
        f"and {of(update, 'space, median', 1)} ms in space on an idle core; 99 of 100 updates leave time for\n"
        f"{of(rate, 'the plane', 0)} a second in the plane, and {of(rate, 'space', 0)} in space. `finish()` takes at\n"
        f"most {slowest:.1f} ms (`python -m bench --only stream`)."
    )


def take_in(name: str, evaluated: Path) -> None:
    """Keep the means of an evaluation that ``kineme evaluate`` wrote, and what it was made with."""
    found = json.loads(evaluated.read_text(encoding="utf-8"))
    protocols = {
        protocol: {
            method: {
                condition: {measure: {"mean": values["mean"]} for measure, values in measures.items()}
                for condition, measures in outcome.items()
            }
            for method, outcome in by_method.items()
        }
        for protocol, by_method in found["protocols"].items()
    }
    kept = {key: found[key] for key in ("movements", "splits", "seed", "versions", "absent_methods")}
    text = json.dumps(kept | {"protocols": protocols}, indent=1)
    (RESULTS / f"evaluation-{name}.json").write_text(f"{text}\n", encoding="utf-8")


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        take_in(argument.partition("=")[0], Path(argument.partition("=")[2]))
    for module in GUIDES:
        fill(module.PAGE, module.tables())
    fill(exported.PAGE, exported.tables())
    fill(concept_tables.PAGE, {"speed": concept_tables.speed()})
    for guide, texts in (recognition() | large_archives.tables() | motion_layer.tables() | planning.tables()).items():
        fill(guide, texts)
    for page, texts in beside_tables.tables().items():
        fill(DOCS / page, texts)
