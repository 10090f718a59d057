"""
Recognized before it is over
============================

A robot that waits for the end of a gesture is late. A stream takes samples as they come, and says what it is likely
to be, how much of it is done, and where it will end.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

demos = kineme.load_lasa(["CShape", "GShape", "Sine", "Angle", "Spoon", "Worm"])
recognizer = kineme.Recognizer().fit(demos[np.arange(len(demos)) % 7 < 4])
movement = demos[20]  # the last Sine
live = recognizer.stream()
shares, decided = [], None
for t, x in zip(movement.times[::10], movement.positions[::10], strict=True):
    state = live.update(t, x)
    shares.append({guess.label: guess.confidence for guess in state.ranked} | {"unknown": state.unknown})
    if state.label is not None and decided is None:
        decided = t
        print(f"{state.label} after {t:.1f} of {movement.duration:.1f} s")

# %%
names = [*recognizer.classes_, "unknown"]
evidence = np.array([[share.get(name, np.nan) for name in names] for share in shares])
figure, (left, right) = plt.subplots(1, 2, figsize=(8.5, 3), width_ratios=(1.8, 1), layout="constrained")
left.stackplot(movement.times[::10], np.nan_to_num(evidence).T, labels=names, alpha=0.8)
left.axvline(decided, color="black", linestyle="--")
left.set(xlabel="time [s]", ylabel="share of the evidence", ylim=(0, 1), xlim=(0, movement.times[-1]))
figure.legend(loc="outside lower center", ncols=7, fontsize="small")
before = movement.times <= decided
right.plot(*movement.positions.T, color="0.8", linewidth=5)
right.plot(*movement.positions[before].T, color="black")
right.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", title="black: what it had by then")
plt.show()
