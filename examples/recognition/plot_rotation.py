"""
Is it a 6 or a 9?
=================

Every invariance makes some different movements equal. Turned by half a turn, a 6 is a 9; how much a rotation costs is
a choice, and `max_angle` sets a limit.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

t = np.linspace(0, 1, 120)[:, None]
bow = np.hstack((np.cos(0.5 + 2.2 * t), 2.2 * np.sin(0.5 + 2.2 * t)))
turns = np.linspace(2.7, 2.7 + 1.9 * np.pi, 120)[:, None]
six = np.vstack((bow, np.hstack((0.6 * np.cos(turns) - 0.3, 0.6 * np.sin(turns) + 0.45))))
zero = np.hstack((np.cos(2 * np.pi * t), 2 * np.sin(2 * np.pi * t)))
shapes = kineme.Demonstrations.from_arrays([six, -six, zero], labels=["6", "9", "0"])

angles = np.radians(np.arange(0, 181, 5))
turned = [six @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) for a in angles]

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(8.5, 3.2), width_ratios=(1.4, 1))
for max_angle, style in ((np.radians(45), "-"), (None, "--"), (np.pi, ":")):
    recognizer = kineme.Recognizer(max_angle=max_angle).fit(shapes)
    similar = recognizer.log_similarity(turned)
    name = "no limit (default)" if max_angle is None else f"max_angle {np.degrees(max_angle):.0f}°"
    known = list(recognizer.classes_)
    left.plot(np.degrees(angles), similar[:, known.index("6")] - similar[:, known.index("9")], style, label=name)
left.text(4, 0.1, "above: 6, below: 9", fontsize=8, color="0.4")
left.set(xlabel="turned by [°]", ylabel="log similarity to 6 minus to 9", xlim=(0, 180), xticks=np.arange(0, 181, 45))
left.legend()
for k, path in enumerate(turned[::12]):
    right.plot(*(path + np.array([4.5 * k, 0])).T, color="C0")
    right.text(4.5 * k, -3.2, f"{60 * k}°", ha="center", fontsize=8)
right.set_aspect("equal")
right.axis("off")
plt.show()
