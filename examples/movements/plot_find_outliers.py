"""
Recordings that do not belong
=============================

In a folder of a hundred recordings some are labeled wrong and some were cut short. `kineme.find_outliers` compares
each with the others of its label.
"""

import matplotlib.pyplot as plt

import kineme

names = ["Angle", "CShape", "GShape", "Sine", "Spoon", "Worm"]
demos = kineme.load_lasa(names)
labels = demos.labels.copy()
labels[9] = "Sine"  # a CShape under the wrong name
movements = list(demos)
cut = movements[30]
movements[30] = kineme.Trajectory(cut.times[:450], cut.positions[:450], cut.label)  # the recording stopped too early

outliers = kineme.find_outliers(movements, labels).outliers
for outlier in outliers:
    like = outlier.label_of_most_like
    print(f"movement {outlier.index}, labeled {outlier.label}, most like {like}: p = {outlier.p_value:.3f}")

# %%
# The label of the movement that it is most like tells a wrong name from a failed recording.
figure, row = plt.subplots(1, len(names), figsize=(8, 2.1))
indices = [outlier.index for outlier in outliers]
for axes, name in zip(row, names, strict=True):
    for k, movement in enumerate(movements):
        if labels[k] == name:
            odd = k in indices
            axes.plot(*movement.positions.T, color="C1" if odd else "0.75", linewidth=2 if odd else 1, zorder=2 + odd)
    axes.set(title=name, aspect="equal", adjustable="datalim")
    axes.axis("off")
figure.suptitle("gray: as the others of the label; orange: found", fontsize=9)
plt.show()
