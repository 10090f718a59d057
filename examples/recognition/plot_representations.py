"""
Seven ways to look at a movement
================================

A recognizer compares movements in seven representations and averages narrow kernels, so that one representation in
which two movements are close suffices. Which one carries the answer depends on what was done to the movement. With
one demonstration of each shape, what is changed too much counts as unknown.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

demos = kineme.load_lasa()
recognizer = kineme.Recognizer().fit(demos[::7])
path = demos[66].positions[::5]
quarter = np.array([[0.0, 1.0], [-1.0, 0.0]])
movements = {
    "another demonstration": path,
    "turned by a quarter": path @ quarter,
    "half as high": path * [1.0, 0.5],
    "drawn from the other end": path[::-1],
    "noise, 2 % of its size": path + np.random.default_rng(0).normal(scale=0.02 * np.ptp(path), size=path.shape),
}
answers = recognizer.recognize(list(movements.values()))

# %%
figure, (drawn, axes) = plt.subplots(1, 2, figsize=(9, 3.4), width_ratios=(1, 6), layout="constrained")
left = np.zeros(len(answers))
for name in answers[0].responsibilities:
    share = np.array([answer.responsibilities[name] for answer in answers])
    axes.barh(list(movements), share, left=left, label=name, height=0.6)
    left += share
for k, (answer, one) in enumerate(zip(answers, movements.values(), strict=True)):
    axes.text(1.01, k, f"{answer.ranked[0]}{'' if answer.label else ', unknown'}", va="center", fontsize=8)
    centered = (one - one.mean(axis=0)) / 60
    drawn.plot(centered[:, 0], centered[:, 1] - k, color="black", linewidth=1)
drawn.set(aspect="equal", ylim=(-len(answers) + 0.5, 0.5))
drawn.axis("off")
axes.set(xlabel="share of each representation in the similarity to the shape that was shown", xlim=(0, 1.0))
axes.invert_yaxis()
figure.legend(loc="outside upper center", ncols=4, columnspacing=1.0)
plt.show()
