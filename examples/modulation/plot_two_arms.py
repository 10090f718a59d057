"""
Two arms that carry one thing
=============================

Two hands reach for a box, lift it over something and let go. Each was recorded alone, so their distance varies.
Coupled, they keep it while they carry, and both give way a little.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

u = np.linspace(0, 1, 150)
s = 10 * u**3 - 15 * u**4 + 6 * u**5
hands = [
    np.column_stack((-0.45 + 0.8 * s, 0.30 * np.sin(np.pi * u) ** 2)),
    np.column_stack((0.05 + 0.8 * s - 0.25 * np.sin(np.pi * u) ** 2, 0.38 * np.sin(np.pi * u) ** 2)),
]
alone = kineme.DMP().learn(hands)
left, right = kineme.couple(alone[0], alone[1], during=(0.25, 0.75), offset=[0.2, 0.0])
paths = [one.rollout(n_samples=101).positions[0] for one in (left, right)]

# %%
figure, (where, apart) = plt.subplots(1, 2, figsize=(8.5, 3), width_ratios=(1.7, 1))
for hand, path, color, name in zip(hands, paths, ("C0", "C1"), ("left hand", "right hand"), strict=True):
    where.plot(*hand.T, color="0.8", linewidth=5)
    where.plot(*path.T, color=color, label=name)
for k in range(25, 76, 5):
    where.plot(*np.array([path[k] for path in paths]).T, color="black", linewidth=1, marker="|")
where.set(xlabel="x [m]", ylabel="height [m]", aspect="equal", title="gray: each alone; black: what they carry")
where.legend()
apart.axvspan(0.25, 0.75, color="C4", alpha=0.2, linewidth=0)
apart.plot(np.linspace(0, 1, 101), paths[1] - paths[0], label=["x", "height"])
apart.plot(u, hands[1] - hands[0], ":", color="0.5")
apart.set(xlabel="time / duration", ylabel="right minus left [m]", xlim=(0, 1))
apart.legend()
plt.show()
