"""What the demonstration wrote."""

from pathlib import Path

page = Path("out/report.html").read_text(encoding="utf-8")
assert page.count("<table") >= 4, "fewer tables than the paper has"
print(f"out/report.html: {len(page) / 1e3:.0f} kB")
