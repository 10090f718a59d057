"""
One long recording, cut into movements
======================================

A session of a minute holds many movements. `kineme.segment` finds them where nothing is known yet: at the rests
between them.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

shapes = kineme.load_lasa(["Angle", "heee", "Sine", "Leaf_1", "Line"])[::7]
times, positions, last = [np.zeros(1)], [np.zeros((1, 2))], np.zeros(2)
for shape in shapes:  # one after the other, 0.8 s of rest between them, and the hand trembles a little
    start = times[-1][-1]
    times += [start + 0.8 * np.arange(1, 50) / 50, start + 0.8 + shape.times]
    positions += [np.repeat(last[None], 49, axis=0), last + shape.positions - shape.positions[0]]
    last = positions[-1][-1]
tremor = np.random.default_rng(0).normal(scale=0.05, size=(sum(map(len, times)), 2))
recording = kineme.Trajectory(np.concatenate(times), np.concatenate(positions) + tremor, name="session")

# %%
# The result is a sequence of movements, taken wherever movements are expected. Each knows where it was cut.
pieces = kineme.segment(recording)
for piece, (start, end) in zip(pieces, pieces.cuts, strict=True):
    print(f"{start:5.2f} to {end:5.2f} s: {len(piece)} samples")

# %%
figure = plt.figure(figsize=(8, 4))
top, bottom = figure.subfigures(2, 1, height_ratios=(1.2, 1))
axes = top.subplots()
axes.plot(recording.times, recording.positions[:, 0], label="x")
axes.plot(recording.times, recording.positions[:, 1], label="y")
axes.set(xlabel="time [s]", ylabel="position [mm]", xlim=(0, recording.times[-1]))
axes.legend(loc="upper left")
for k, (small, piece) in enumerate(zip(bottom.subplots(1, len(pieces)), pieces, strict=True)):
    axes.axvspan(*pieces.cuts[k], color=f"C{k + 2}", alpha=0.2, linewidth=0)
    small.plot(*piece.positions.T, color=f"C{k + 2}")
    small.set(aspect="equal", adjustable="datalim", title=f"movement {k + 1}")
    small.axis("off")
plt.show()
