"""An audit as one HTML page: the verdict, a picture of all episodes, and a strip of each one that is flagged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.audit.motion import motion_of
from kineme.audit.report import checks_table, findings_table, reasons_of, verdict
from kineme.audit.run import KINDS, Audit, Finding
from kineme.movements.episodes import Episode
from kineme.reporting.page import page
from kineme.reporting.table import Table
from kineme.reporting.text import in_markup
from kineme.sampling import evenly_spaced
from kineme.validation import Array

DRAWN = 40  # episodes with a strip, at most
_LISTED = 400  # episodes of the table
_DOTS = 4000  # episodes of the picture
_WIDTH, _HEIGHT, _STRIP = 1040, 220, 110  # pixels
_LEFT, _RIGHT, _ABOVE, _BELOW = 44, 12, 8, 24
_BINS = 240  # pairs of extremes of a line
_LINES = 16  # of a strip
#: Of the style of the page, which has others in the dark.
_COLORS = {
    "contradiction": "var(--purple)", "outlying": "var(--orange)", "unusual": "var(--blue)", "ranked": "var(--blue)",
}  # fmt: skip
_NARROWEST = 4  # pixels of a stretch
_SMALL = 'font-size="12" fill="var(--soft)"'


def audit_page(audit: Audit, name: str, episodes: Iterable[Episode], facts: Mapping[str, Any]) -> str:
    """Return the page of an audit of the data set `name`; strips are drawn of those `episodes` that are given.

    Only the first 40 findings have a strip: `drawn_episodes` tells which episodes to read again.
    """
    findings = {finding.episode: finding for finding in audit.findings[:DRAWN]}
    strips = {
        episode.number: _strip(episode, findings[episode.number]) for episode in episodes if episode.number in findings
    }
    parts = [_picture(audit)]
    if audit.of_the_set:
        notes = "".join(f"<li>{in_markup(note)}</li>" for note in audit.of_the_set)
        parts.append(f"<h2>Of the whole set</h2><ul>{notes}</ul>")
    checks = checks_table(audit)
    if checks.rows:
        parts.append(_table("Reasons", checks))
    if findings:
        parts.append("<h2>Episodes</h2>")
    for number, finding in findings.items():
        task = f", {in_markup(finding.task)}" if finding.task else ""
        reasons = "".join(f"<li>{in_markup(reason)}</li>" for reason in reasons_of(finding))
        sure = "" if finding.kind == "contradiction" else f", p = {finding.p_value:.2g}"
        parts.append(
            f'<figure id="episode-{number}"><figcaption><b>Episode {number}</b>{task}: '
            f"{_kind(finding.kind)}{sure}</figcaption>"
            f"{strips.get(number, '')}<ul>{reasons}</ul></figure>"
        )
    if others := audit.findings[DRAWN : DRAWN + _LISTED]:
        parts.append(_table("And these", findings_table(others, 1)))
    if (more := len(audit.findings) - DRAWN - _LISTED) > 0:
        parts.append(f"<p>and {more:,} more, which the table of --train-mask and --json list.</p>")
    return page(f"kineme: audit of {name}", f"Audit of {name}", [verdict(audit)], "\n".join(parts), dict(facts))


def drawn_episodes(audit: Audit) -> frozenset[int]:
    """Return the numbers of the episodes that a page draws."""
    return frozenset(finding.episode for finding in audit.findings[:DRAWN])


def _table(title: str, table: Table) -> str:
    head = "".join(f"<th>{in_markup(cell)}</th>" for cell in table.columns)
    body = "".join(f"<tr>{''.join(f'<td>{in_markup(cell)}</td>' for cell in row)}</tr>" for row in table.rows)
    return f"<h2>{in_markup(title)}</h2><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _kind(kind: str) -> str:
    """Return a kind with a square of its color, which is too light for a text."""
    return f'<span aria-hidden="true" style="color:{_COLORS[kind]}">&#9632;</span> <b>{kind}</b>'


def _svg(height: int, label: str, parts: Iterable[str]) -> str:
    return (
        f'<svg role="img" aria-label="{in_markup(label)}" viewBox="0 0 {_WIDTH} {height}" width="100%" '
        f'font-family="system-ui, sans-serif">{"".join(parts)}</svg>'
    )


def _picture(audit: Audit) -> str:
    """Draw all episodes: how unusual each is, over its place in the set; those that contradict at the top."""
    n = len(audit.numbers)
    kinds = {finding.episode: finding.kind for finding in audit.findings}
    chosen = np.union1d(evenly_spaced(n, _DOTS), np.flatnonzero(audit.flagged)[:_DOTS])
    levels = np.log1p(audit.evidence)
    top = max(float(levels.max()), 2.0) * 1.08
    broken = np.array([kinds.get(int(number)) == "contradiction" for number in audit.numbers])
    x = _LEFT + (_WIDTH - _LEFT - _RIGHT) * (np.arange(n) + 0.5) / n
    y = _ABOVE + (_HEIGHT - _ABOVE - _BELOW) * (1 - np.where(broken, top, levels) / top)
    parts = []
    for share in (0.5, 0.05, 1e-3, 1e-6, 1e-12):
        if (level := np.log1p(-np.log(share))) < top:
            at = _ABOVE + (_HEIGHT - _ABOVE - _BELOW) * (1 - level / top)
            parts.append(f'<path d="M{_LEFT} {at:.0f}H{_WIDTH - _RIGHT}" stroke="var(--line)"/>')
            parts.append(f'<text x="{_LEFT - 4}" y="{at + 4:.0f}" text-anchor="end" {_SMALL}>{share:g}</text>')
    for at in np.argsort(audit.flagged[chosen], kind="stable"):
        k = int(chosen[at])
        number = int(audit.numbers[k])
        color = _COLORS[kinds[number]] if audit.flagged[k] and number in kinds else "var(--dot)"
        dot = f'<circle cx="{x[k]:.1f}" cy="{y[k]:.1f}" r="{4 if audit.flagged[k] else 2}" fill="{color}"/>'
        parts.append(f"<g><title>episode {number}</title>{dot}</g>" if audit.flagged[k] else dot)
    parts.append(f'<text x="{_LEFT}" y="{_HEIGHT - 6}" {_SMALL}>episode {audit.numbers[0]}</text>')
    parts.append(
        f'<text x="{_WIDTH - _RIGHT}" y="{_HEIGHT - 6}" text-anchor="end" {_SMALL}>episode {audit.numbers[-1]}</text>'
    )
    drawn = "" if len(chosen) == n else f" {len(chosen):,} of {n:,} episodes are drawn."
    legend = " ".join(f"{_kind(kind)}: {in_markup(words)}" for kind, words in KINDS.items() if kind in kinds.values())
    label = f"{audit.flagged.sum()} of {n} episodes are flagged"
    return (
        f"<figure>{_svg(_HEIGHT, label, parts)}<figcaption>Every dot is an episode; the higher, the more unusual: the "
        f"share of good episodes that are as unusual, about.{drawn} {legend}</figcaption></figure>"
    )


def _strip(episode: Episode, finding: Finding) -> str:
    """Draw the channels over time, each over the whole height, and the stretches of the reasons behind them."""
    motion = motion_of(episode)
    if motion is None:
        return ""
    seconds = max(float(motion.times[-1]), 1e-9)
    width, height = _WIDTH - _LEFT - _RIGHT, _STRIP - _ABOVE - _BELOW
    color = _COLORS[finding.kind]
    parts = [
        f'<rect x="{_LEFT}" y="{_ABOVE}" width="{width}" height="{height}" fill="var(--raised)" stroke="var(--line)"/>'
    ]
    for reason in finding.reasons:
        if 0 < reason.end - reason.start < 0.98 * seconds or reason.end == reason.start > 0:
            wide = max(_NARROWEST, width * (reason.end - reason.start) / seconds)
            left = _LEFT + min(width - wide, width * reason.start / seconds)
            parts.append(
                f'<rect x="{left:.1f}" y="{_ABOVE}" width="{wide:.1f}" height="{height}" fill="{color}" '
                f'fill-opacity=".25"><title>{in_markup(reason.check)}</title></rect>'
            )
    guilty = [motion.names.index(reason.channel) for reason in finding.reasons[:2] if reason.channel in motion.names]
    others = [k for k in evenly_spaced(len(motion.names), _LINES).tolist() if k not in guilty]
    for k in [*others, *guilty[::-1]]:
        line = _line(motion.times / seconds, motion.state[:, k])
        points = " ".join(f"{_LEFT + width * a:.0f},{_ABOVE + height * (1 - b):.1f}" for a, b in line.tolist())
        look = f'stroke="{color}" stroke-width="1.6"' if k in guilty else 'stroke="var(--gray)" stroke-width=".7"'
        parts.append(
            f'<polyline points="{points}" fill="none" {look}><title>{in_markup(motion.names[k])}</title></polyline>'
        )
    parts += [
        f'<text x="{_LEFT}" y="{_STRIP - 8}" {_SMALL}>0 s</text>',
        f'<text x="{_WIDTH - _RIGHT}" y="{_STRIP - 8}" text-anchor="end" {_SMALL}>{seconds:.1f} s</text>',
    ]
    if guilty:
        name = in_markup(motion.names[guilty[0]])
        parts.append(f'<text x="{_WIDTH / 2}" y="{_STRIP - 8}" text-anchor="middle" {_SMALL}>{name}</text>')
    return _svg(_STRIP, f"the channels of episode {episode.number} over {seconds:.1f} s", parts)


def _line(times: Array, values: Array) -> NDArray[np.float64]:
    """Return points (n, 2) of a line from 0 to 1: the extremes of even pieces, in the order in which they occur."""
    low, high = float(values.min()), float(values.max())
    heights = (values - low) / (high - low) if high > low else np.full(len(values), 0.5)
    starts = np.unique(np.linspace(0, len(values), _BINS, endpoint=False).astype(np.intp))
    pieces = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(values))))
    order = np.lexsort((heights, pieces))
    ends = np.append(starts[1:], len(values)) - 1
    rows = np.unique(np.concatenate([order[starts], order[ends]]))
    return np.stack([np.clip(times[rows], 0, 1), heights[rows]], axis=1)
