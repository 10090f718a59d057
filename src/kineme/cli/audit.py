"""``kineme audit``: which episodes of a set of robot data are bad."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from kineme.cli.options import (
    FILE,
    Finite,
    GroupedCommand,
    error_rate_option,
    force_option,
    json_option,
    rerun_option,
    under,
)
from kineme.cli.output import check_new, progress, say
from kineme.reporting.text import printable


@click.command(cls=GroupedCommand, short_help="Find the bad episodes of a set of robot data.")
@click.argument("dataset", type=click.Path(path_type=Path))
@error_rate_option("Share of good episodes that may be flagged.")
@click.option("--rate", type=Finite(0, min_open=True), help="Samples per second, where the data set does not say it.")
@under(
    "Output",
    click.option("--output", "-o", type=FILE, help="One HTML page: the verdict, and a strip of each flagged episode."),
    click.option(
        "--train-mask", "mask", type=FILE,
        help="Which episodes to train on: a .csv table, or a .json list of the numbers of those that are kept.",
    ),
)  # fmt: skip
@rerun_option
@json_option
@force_option
def audit(dataset: Path, error_rate: float, output: Path | None, mask: Path | None, **options: Any) -> None:
    """Audit DATASET, a folder or file with episodes of robot data: which are bad, why, where, and what to do.

    Episodes are compared with the others of their task: ways, rests, spikes, jerk, frozen channels, ranges, durations,
    lag and offset of action and state. Of good episodes about the error rate or less is flagged;
    it takes 20 episodes to say that at 0.05. Stamps, rates and frames that contradict what the set declares are flagged
    by themselves. Nothing is changed.

    The exit status is 0 if episodes were read, whatever was flagged, 1 if none were, and 2 for options that are none.

    Example: kineme audit lerobot_dataset/ -o audit.html --train-mask keep.csv
    """
    from kineme.audit.page import audit_page, drawn_episodes
    from kineme.audit.report import audit_as_data, audit_as_words, lerobot_arguments, write_kept
    from kineme.audit.run import audit_episodes
    from kineme.io.reading.episodes import read_episodes
    from kineme.reporting.atomic import whole_file

    rerun, force = options["rerun"], options["force"]
    endings = ((output, (".html", ".htm")), (mask, (".csv", ".json")), (rerun, None))
    for path, allowed in endings:
        if path is not None:
            check_new(path, force, dataset)
            if allowed and path.suffix.lower() not in allowed:
                raise click.UsageError(f"expected a path ending in {' or '.join(allowed)}, got {printable(path)}")
            if not path.parent.is_dir():
                raise click.UsageError(f"expected a folder to write into, there is none at {printable(path.parent)}")
    with progress(desc="auditing", unit="episode") as bar:
        result = audit_episodes(read_episodes(dataset, rate=options["rate"]), error_rate, bar.update)
    written = []
    if mask is not None:
        written.append(write_kept(mask, result, replace=force))
    if output is not None or rerun is not None:
        drawn = drawn_episodes(result)
        episodes = (
            [episode for episode in read_episodes(dataset, rate=options["rate"]) if episode.number in drawn]
            if drawn
            else []
        )
        if output is not None:
            facts = {"data set": dataset, "error rate": error_rate, "episodes": len(result.numbers)}
            text = audit_page(result, dataset.resolve().name, episodes, facts)
            with whole_file(output, replace=force) as beside:
                beside.write_text(text, encoding="utf-8")
            written.append(output)
        if rerun is not None:
            written.append(_write_rerun(rerun, result, episodes, force))
    data = audit_as_data(result) | {"written": list(map(str, written))}
    if mask is not None:
        data["lerobot"] = lerobot_arguments(result, mask)
    say(options["as_json"], data, lambda: _text(audit_as_words(result), data))


def _write_rerun(path: Path, result: Any, episodes: list[Any], force: bool) -> Path:
    """Write the flagged episodes that are drawn, with a lane for each reason."""
    from kineme.io.writing.rerun import Stretch, episode_scene, write_rerun

    reasons = {finding.episode: finding.reasons for finding in result.findings}

    def lanes(episode: Any) -> dict[str, list[Stretch]]:
        begin = next((float(stamp) for stamp in episode.times if math.isfinite(stamp)), 0.0)
        return {
            reason.check: [Stretch(begin + reason.start, begin + reason.end, reason.words)]
            for reason in reasons[episode.number]
        }

    scenes = (episode_scene(episode, lanes(episode)) for episode in episodes if len(episode))
    return write_rerun(path, scenes, replace=force)


def _text(words: str, data: dict[str, Any]) -> str:
    lines = [words]
    if "lerobot" in data:
        lines += ["", "to train on the others with LeRobot:", *(f"    {line}" for line in data["lerobot"])]
    return "\n".join([*lines, *(f"written to {printable(path)}" for path in data["written"])])
