"""Recordings of two shapes, a folder each, as a user has them; one more to be recognized."""

from pathlib import Path

import numpy as np

import kineme

demos = kineme.load_lasa(["CShape", "Sine"])
for k, (label, movement) in enumerate(zip(demos.labels, demos, strict=True)):
    folder = Path("new" if k in {0, 7} else f"recordings/{label}")
    folder.mkdir(parents=True, exist_ok=True)
    columns = np.column_stack((movement.times, movement.positions / 1000))
    np.savetxt(folder / f"{label}{k}.csv", columns, delimiter=",", header="t,x,y", comments="")
