"""The table of docs/guide/tensors.md on a GPU, from the file of results."""

from __future__ import annotations

from result_tables.measured import DOCS, content

PAGE = DOCS / "guide" / "tensors.md"


def tables() -> dict[str, str]:
    """Name of each table or sentence -> its text."""
    measured = content("gpu")
    by_work: dict[str, dict[int, tuple[float, float | None]]] = {}
    for row in measured["rows"]:
        work, _, size = row["what"].removesuffix(" at once").rpartition(", ")
        by_work.setdefault(work, {})[int(size)] = row["ours"], row["peer"]
    sizes = list(by_work["rollout"])
    card, cores = measured["rows"][0]["details"]["card"], measured["rows"][0]["peer_name"]
    lines = [f"| {card} / {cores} beside it | {' | '.join(f'{size:,} at once' for size in sizes)} |"]
    lines.append("|---" * (len(sizes) + 1) + "|")
    lines += [f"| {work} | {' | '.join(_cell(*of[size]) for size in sizes)} |" for work, of in by_work.items()]
    gpu, processor = by_work["rollout"][sizes[-1]]
    sentence = (
        f"Milliseconds for movements of 201 samples in 7 dimensions, in single precision: {gpu / sizes[-1] * 1e6:.0f} "
        f"nanoseconds for\none of {sizes[-1]:,} rollouts on the GPU, {(processor or 0) / sizes[-1] * 1e6:,.0f} on the "
        f"processor. PyTorch {measured['versions']['torch']} (`python -m bench --only gpu`)."
    )
    return {"gpu": "\n".join([*lines, "", sentence])}


def _cell(gpu: float, processor: float | None) -> str:
    return f"{_short(gpu)} / {'-' if processor is None else _short(processor)}"


def _short(ms: float) -> str:
    """Two digits, all of a whole number."""
    return f"{ms:,.0f}" if ms >= 10 else f"{ms:.2g}"
