"""
Two ways of doing one thing
===========================

Where people do the same thing in different ways, the average is none of them. Styles are the few directions in which
demonstrations differ, and a style is a number to choose.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme
from kineme.styles import learn_styles

demos = kineme.load_lasa(["Multi_Models_3"])
model = learn_styles(kineme.DMP().learn(demos), n_styles=2)
print("variance explained:", model.explained_variance[:3].round(2))

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.4))
for demo in demos:
    left.plot(*demo.positions.T, color="0.7", linewidth=3)
between = model.interpolate(model.styles[0], model.styles[6], 9)
for path, color in zip(between.rollout().positions, plt.cm.viridis(np.linspace(0, 0.9, 9)), strict=True):
    left.plot(*path.T, color=color)
left.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", title="from one style to the other")
right.axhline(0, color="0.85", linewidth=0.8)
right.axvline(0, color="0.85", linewidth=0.8)
right.scatter(*model.styles.T, color="0.4", label="demonstrations")
line = np.linspace(model.styles[0], model.styles[6], 9)
right.scatter(*line.T, c=np.linspace(0, 0.9, 9), vmin=0, vmax=1, marker="s", s=16, label="between them")
right.set(xlabel="style 1", ylabel="style 2", title="the demonstrations, as two numbers each")
right.legend()
plt.show()
