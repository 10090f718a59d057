"""Table and sentence of docs/guide/adapting.md, from the file of results."""

from __future__ import annotations

from result_tables.measured import DOCS, rows

PAGE = DOCS / "guide" / "adapting.md"
_RECORDINGS = {"LASA": "LASA", "letters": "capital letters", "gestures": "gestures in space, 30 Hz"}


def tables() -> dict[str, str]:
    """Name of each table or sentence -> its text."""
    return {"rollouts": _rollouts(), "chosen": _chosen()}


def _rollouts() -> str:
    found = {row["what"].partition(":")[0]: row for row in rows("adapting") if "rollouts to a via point" in row["what"]}
    first, second = (found[method]["ours"] for method in ("cma-es", "pi-bb"))
    seeds = found["cma-es"]["details"]["seeds"]
    return (
        "Equal seeds give equal results. A point at 30 % of the extent from the path is met to 1 % of it after\n"
        f"at most {first} rollouts by CMA-ES and {second} by PI^BB, over {seeds} points and seeds\n"
        "(`python -m bench --only adapting`)."
    )


def _chosen() -> str:
    lines = ["| recordings | noise | chosen N, ridge | chosen | default |", "|---|---|---|---|---|"]
    shown = ""
    for row in rows("adapting"):
        name, comma, rest = row["what"].partition(", ")
        if comma and name in _RECORDINGS:
            noise, chosen = rest.split(" noise: ")
            chosen = chosen.replace("N = ", "").replace("ridge ", "").replace("e-0", "e-")
            errors = " | ".join(f"{row[of]:.2f}" if row[of] >= 0.2 else f"{row[of]:.3f}" for of in ("ours", "peer"))
            first = "" if name == shown else _RECORDINGS[name]
            lines.append(
                f"| {first} | {'none' if noise == '0 %' else noise} | {chosen} | {errors} |".replace("|  |", "| |")
            )
            shown = name
    return "\n".join(lines)
