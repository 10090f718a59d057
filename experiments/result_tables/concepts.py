"""The table of speeds of docs/concepts/two-matrices.md."""

from __future__ import annotations

from result_tables.measured import DOCS, rows

PAGE = DOCS / "concepts" / "two-matrices.md"
#: What was measured: file of results, its row and peer -> how the page says it.
ROWS = {
    ("learn_even", "learn 10,000 even movements", "movement_primitives imitate"): "learn movements, evenly sampled",
    ("learn_even", "learn 10,000 even movements", "bare matrix product"): "the same, beside the product alone",
    ("learn_ragged", "learn 10,000 ragged movements", "movement_primitives imitate"): "learn movements of any sampling",
    ("learn_even", "generate 10,000 even movements", "movement_primitives open_loop"): "move again",
    ("gram", "TrE, float64, 4000 x 4000", "scipy cdist cityblock"): "truncated kernel, two sets",
    ("gram", "RBF, float64, 4000 x 4000", "scikit-learn rbf_kernel"): "RBF kernel, two sets",
    ("recognize", "fit and predict in the plane, 26 classes, 10,000 ragged movements", "dtaidistance, 10 % band"): (
        "recognize movements in the plane"
    ),
}
_UNITS = {"/s": "movements a second", "M pairs/s": "million pairs a second"}


def speed() -> str:
    """Lines of the table of speeds."""
    lines = ["| | kineme | | times as fast as |", "|---|---|---|---|"]
    for (file, what, peer), text in ROWS.items():
        (row,) = (row for row in rows(file) if (row["what"], row["peer_name"]) == (what, peer))
        times = f"{row['ratio']:.2g}" if row["ratio"] < 10 else f"{row['ratio']:,.0f}"
        lines.append(f"| {text} | {row['ours']:,.0f} | {_UNITS[row['unit']]} | {times} × {peer} |")
    return "\n".join(lines)
