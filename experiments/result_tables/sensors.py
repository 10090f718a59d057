"""The sentence on live symbols of docs/how-to/sensors.md, from the file of results."""

from __future__ import annotations

from result_tables.measured import DOCS, content, figures

PAGE = DOCS / "how-to" / "sensors.md"


def tables() -> dict[str, str]:
    """Name of each table or sentence -> its text."""
    found, load = figures("sensors"), content("sensors")["load_before"]
    words = ", ".join(
        f"{found[f'from a sample to its symbol, {protocol}, median']:.1f} ms over {protocol}"
        for protocol in ("OSC", "LSL", "ROS 2")
    )
    late = max(found[f"from a sample to its symbol, {protocol}, 95 of 100"] for protocol in ("OSC", "LSL", "ROS 2"))
    return {
        "sensors": "From the push of the sample that decides to the symbol in another process it takes, in the median,"
        f"\n{words}\n"
        f"(95 of 100: at most {late:.0f} ms; on two cores with a load of {load:.0f}, `python -m bench --only sensors`)."
    }
