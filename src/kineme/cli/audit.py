"""``kineme audit``: which episodes of a set of robot data are bad."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import click

from kineme.cli import options as opts
from kineme.cli.output import check_new, progress, say
from kineme.cli.pieces import how_divided, in_pieces, pieces_options
from kineme.cli.reading import Recording
from kineme.reporting.text import printable


@click.command(cls=opts.GroupedCommand, short_help="Find the bad episodes of a set of robot data.")
@click.argument("dataset", type=Recording(allow_dash=False))
@opts.error_rate_option("Share of good episodes that may be flagged.")
@click.option(
    "--rate", type=opts.Finite(0, min_open=True), help="Samples per second, where the data set does not say it."
)
@opts.heading("Output")
@click.option(
    "--output", "-o", type=click.Path(path_type=Path),
    help="One HTML page: the verdict, a strip of each flagged episode; of a large archive, a folder of parts.",
)  # fmt: skip
@click.option(
    "--train-mask", "mask", type=opts.FILE,
    help="Which episodes to train on: a .csv table, or a .json list of the numbers of those that are kept.",
)  # fmt: skip
@opts.rerun_option
@opts.json_option
@opts.force_option
@pieces_options
def audit(dataset: Path, error_rate: float, output: Path | None, mask: Path | None, **options: Any) -> None:
    """Audit DATASET, a folder or file with episodes of robot data: which are bad, why, where, and what to do.

    Episodes are compared with the others of their task: ways, rests, spikes, jerk, frozen channels, ranges, durations,
    lag and offset of action and state. Of good episodes about the error rate or less is flagged;
    it takes 20 episodes to say that at 0.05. Stamps, rates and frames that contradict what the set declares are flagged
    by themselves. Nothing is changed.

    The exit status is 0 if episodes were read, whatever was flagged, 1 if none were, and 2 for options that are none.

    Example: kineme audit lerobot_dataset/ -o audit.html --train-mask keep.csv
    """
    from kineme.audit.run import audit_episodes
    from kineme.io.reading.episodes import read_episodes
    from kineme.pieces.archive import is_remote

    how = how_divided(options, [dataset])
    if how is not None:
        if given := [name for name in ("mask", "rerun") if {"mask": mask, **options}[name] is not None]:
            raise click.UsageError(f"expected --{given[0].replace('mask', 'train-mask')} with kineme gather")
        if not is_remote(str(dataset)):
            read_episodes(dataset, rate=options["rate"])  # refuses what is none, or several, before any is read
        asked = {"reading": {}, "error_rate": error_rate, "rate": options["rate"]}
        in_pieces("audit", [dataset], output, how, asked, force=options["force"], as_json=options["as_json"])
        return
    files = AuditFiles(output, mask, options["rerun"])
    files.check(options["force"], dataset)
    with progress(desc="auditing", unit="episode") as bar:
        result = audit_episodes(read_episodes(dataset, rate=options["rate"]), error_rate, bar.update)
    data = files.write(result, dataset, lambda: read_episodes(dataset, rate=options["rate"]), options["force"])
    say(options["as_json"], data, lambda: audit_text(result, data))


class AuditFiles(NamedTuple):
    """What to write of an audit: a page, a mask for training, and a recording for Rerun."""

    page: Path | None
    mask: Path | None
    rerun: Path | None = None

    def check(self, force: bool, dataset: Path) -> None:
        """Refuse paths that cannot be written, before anything is read."""
        check_new(self.page, force, dataset, endings=(".html", ".htm"), flag="--output")
        check_new(self.mask, force, dataset, endings=(".csv", ".json"), flag="--train-mask")
        check_new(self.rerun, force, dataset, endings=(".rrd",), flag="--rerun")

    def write(self, result: Any, dataset: Path, read: Callable[[], Iterable[Any]], force: bool) -> dict[str, Any]:
        """Write them, and return the audit as data; flagged episodes are read again where they are drawn."""
        from kineme.audit.page import audit_page, drawn_episodes
        from kineme.audit.report import audit_as_data, lerobot_arguments, write_kept
        from kineme.reporting.atomic import whole_file

        written = [] if self.mask is None else [write_kept(self.mask, result, replace=force)]
        if self.page is not None or self.rerun is not None:
            drawn = drawn_episodes(result)
            episodes = [episode for episode in read() if episode.number in drawn] if drawn else []
            if self.page is not None:
                facts = {"data set": dataset, "error rate": result.error_rate, "episodes": len(result.numbers)}
                text = audit_page(result, dataset.resolve().name, episodes, facts)
                with whole_file(self.page, replace=force) as beside:
                    beside.write_text(text, encoding="utf-8")
                written.append(self.page)
            if self.rerun is not None:
                written.append(_write_rerun(self.rerun, result, episodes, force))
        data = audit_as_data(result) | {"written": list(map(str, written))}
        return data if self.mask is None else data | {"lerobot": lerobot_arguments(result, self.mask)}


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


def audit_text(result: Any, data: dict[str, Any]) -> str:
    """Write an audit in words, with how to train on the episodes that are kept, and what was written."""
    from kineme.audit.report import audit_as_words

    lines = [audit_as_words(result)]
    if "lerobot" in data:
        lines += ["", "to train on the others with LeRobot:", *(f"    {line}" for line in data["lerobot"])]
    return "\n".join([*lines, *(f"written to {printable(path)}" for path in data["written"])])
