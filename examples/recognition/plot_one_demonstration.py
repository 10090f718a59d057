"""
Known from one demonstration
============================

One demonstration of each of 26 shapes is all that the recognizer gets. The movements to recognize are other
demonstrations, moved, turned, scaled, hurried and noisy.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

demos = kineme.load_lasa()
recognizer = kineme.Recognizer().fit(demos[::7])
others = demos[np.arange(len(demos)) % 7 == 3]
varied = kineme.movements.Perturbation(shift=2.0, scale=1.0, rotation=np.radians(20), warp=0.35, noise=0.01).apply(
    others, 1
)
answers = recognizer.predict(varied)
print(f"{np.mean(answers == others.labels):.0%} of {len(varied)} recognized")

# %%
figure, panels = plt.subplots(2, 8, figsize=(9.6, 2.8))
for axes, k in zip(panels.T, range(0, 24, 3), strict=True):
    axes[0].plot(*demos[7 * k].positions.T)
    right = answers[k] == others.labels[k]
    axes[1].plot(*varied[k].positions.T, color="C2" if right else "C1", linewidth=0.8)
    axes[0].set_title(demos[7 * k].label, fontsize=8)
    axes[1].set_title(answers[k], fontsize=8, color="C2" if right else "C1")
    for one in axes:
        one.set(aspect="equal", adjustable="datalim")
        one.axis("off")
figure.suptitle("shown once (blue), and recognized (green)", fontsize=9)
plt.show()
