"""Write what was measured into the pages of concepts: ``make tables``."""

from __future__ import annotations

import json
from pathlib import Path

from make_tables import RESULTS

PAGE = Path(__file__).parent / "concepts" / "two-matrices.md"
#: What was measured: file of `RESULTS`, its row and peer -> how the page says it.
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
        rows = json.loads((RESULTS / f"{file}.json").read_text(encoding="utf-8"))["rows"]
        (row,) = (row for row in rows if (row["what"], row["peer_name"]) == (what, peer))
        times = f"{row['ratio']:.2g}" if row["ratio"] < 10 else f"{row['ratio']:,.0f}"
        lines.append(f"| {text} | {row['ours']:,.0f} | {_UNITS[row['unit']]} | {times} × {peer} |")
    return "\n".join(lines)


def filled(page: str) -> str:
    """The page with the table between its marks."""
    begin, end = "<!-- table: speed -->\n", "<!-- end -->"
    before, _, rest = page.partition(begin)
    return f"{before}{begin}{speed()}\n{end}{rest.partition(end)[2]}"


if __name__ == "__main__":
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    print(PAGE)
