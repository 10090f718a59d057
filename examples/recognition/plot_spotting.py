"""
Known movements in a long recording
===================================

Three shapes are known. In one recording they occur beside others, with motion between them; `spot` says what happens
when, and calls unknown what is none of them.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

known = kineme.load_lasa(["Angle", "CShape", "Sine"])
recognizer = kineme.Recognizer().fit(known[np.arange(21) % 7 < 5])
order = [known[5], kineme.load_lasa(["heee"])[0], known[20], known[12], kineme.load_lasa(["Zshape"])[0], known[6]]
times, positions = [np.zeros(1)], [np.zeros((1, 2))]
for one in order:  # one after the other, half a second of rest between them
    times.append(one.times - one.times[0] + times[-1][-1] + 0.5)
    positions.append(one.positions - one.positions[0] + positions[-1][-1])
recording = kineme.Trajectory(np.concatenate(times), np.concatenate(positions))

found = recognizer.spot(recording)
for one in found:
    print(f"{one.start:5.1f} to {one.end:5.1f} s: {one.label or 'unknown'}, {one.confidence:.2f}")

# %%
figure, axes = plt.subplots(figsize=(9, 3))
axes.plot(recording.times, recording.positions, color="0.3", linewidth=1)
colors = {"Angle": "C0", "CShape": "C1", "Sine": "C2", None: "0.8"}
for one in found:
    axes.axvspan(one.start, one.end, color=colors[one.label], alpha=0.3, linewidth=0)
    axes.text(
        (one.start + one.end) / 2, 1.02, one.label or "unknown", ha="center", transform=axes.get_xaxis_transform()
    )
axes.set(xlabel="time [s]", ylabel="x and y [mm]", xlim=(0, recording.times[-1]))
plt.show()
