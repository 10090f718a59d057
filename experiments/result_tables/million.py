"""Tables of docs/tutorials/a-million-movements.md, from the files of results."""

from __future__ import annotations

from typing import Any

from result_tables.measured import content, figures, rows

_SVM = ("train on 1,000,000 movements", "accuracy after 1,000,000", "accuracy of the exact kernel, 4,000 movements")


def tables() -> dict[str, str]:
    """Name of each table or sentence -> its text."""
    return {"parts": _parts(), "disk": _disk(), "machine": _machine(), "two millions": _two_millions(), "svm": _svm()}


def by_part() -> dict[str, dict[int, dict[str, Any]]]:
    """Part of the page -> number of movements -> processor seconds and peak of memory [MB]."""
    found: dict[str, dict[int, dict[str, Any]]] = {}
    for row in rows("million"):
        if part := row["details"].get("part"):
            took = {"seconds": row["ours"], "megabytes": row["details"]["megabytes"]}
            found.setdefault(part, {})[row["details"]["movements"]] = took
    return found


def _parts() -> str:
    parts = by_part()
    counts = sorted(next(iter(parts.values())))
    lines = [
        f"| processor time | {' | '.join(f'{count:,}' for count in counts)} | peak of memory at {counts[-1]:,} |",
        "|---" * (len(counts) + 2) + "|",
    ]
    for part, took in parts.items():
        times = " | ".join(_seconds(took[count]["seconds"]) for count in counts)
        lines.append(f"| {part} | {times} | {took[counts[-1]]['megabytes']:,.0f} MB |")
    return "\n".join(lines)


def _seconds(value: float) -> str:
    return f"{value:,.0f} s" if value >= 10 else f"{value:.2g} s"


def _disk() -> str:
    """What the folders of the page hold at the end, with the most movements."""
    folders = [row for row in rows("million") if "folder" in row["details"]]
    most = max(row["details"]["movements"] for row in folders)
    sizes = [(row["details"]["folder"], row["ours"]) for row in folders if row["details"]["movements"] == most]
    return f"On disk, {most:,} movements: {', '.join(f'{size / 1000:.2g} GB in `{name}/`' for name, size in sizes)}."


def _machine() -> str:
    found = content("million")
    machine, versions = found["machine"], found["versions"]
    where = f"{machine['cores']} cores ({machine['cpu']}, {machine['system']})"
    named = f"Python {versions['python']}, NumPy {versions['numpy']} and Numba {versions['numba']}"
    return f"On {where} with {named}. `python -m bench --only million` runs this page and measures it anew."


def _two_millions() -> str:
    found = {row["what"].strip(): row for row in rows("library-2000000")}
    learned, accuracy = found["2,000,000 movements, 2-D: learn"], found["accuracy"]
    first, each = (found[what]["ours"] for what in ("first answer, caches made", "recognize one, median"))
    return (
        f"With {learned['details']['n']:,} movements of 200 samples, {learned['ours']:,.0f} are stored per second, "
        f"the first answer takes {first / 1000:.0f} s, and each further one {each:.0f} ms. The best-ranked symbol is "
        f"right for {accuracy['ours']:.0%} of {learned['details']['questions']} movements, and for "
        f"{accuracy['peer']:.0%} when all are compared (`KINEME_BENCH_MOVEMENTS=2000000 "
        "python -m bench --only library`)."
    )


def _svm() -> str:
    found = figures("binning")
    seconds, accuracy, exact = (found[what] for what in _SVM)
    return (
        f"A linear SVM on `kineme.kernels.RandomBinning` features of a million movements trains in {seconds:.0f} s, "
        f"with accuracy {accuracy:.3f}; a kernel SVM of 4,000 movements has {exact:.3f} "
        "(`python -m bench --only binning`)."
    )
