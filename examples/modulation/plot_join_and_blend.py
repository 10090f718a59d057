"""
One movement after another, one turning into another
====================================================

`join` makes one primitive of several, without a stop between them. `blend` begins as one movement and ends as
another.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

learned = kineme.DMP().learn(kineme.load_lasa(["CShape", "Sine"]))
c, sine = learned[0], learned[7]
joined = {
    "joined": kineme.join([c, sine], shift=True),
    "with an overlap of 1 s": kineme.join([c, sine], shift=True, overlap=1.0),
}
turning = kineme.blend(c, sine, (0.3, 0.6))

# %%
figure, (left, middle, right) = plt.subplots(1, 3, figsize=(9.5, 3))
for (name, one), style in zip(joined.items(), ("-", "--"), strict=True):
    path = one.rollout(rate=100)
    left.plot(*path.positions[0].T, style, label=name)
    middle.plot(path.times[0], np.linalg.norm(path.velocities[0], axis=1), style)
left.set(title="a C, then a sine", xlabel="x [mm]", ylabel="y [mm]", aspect="equal", ylim=(-10, 58))
left.legend(loc="upper right", fontsize="small")
middle.set(title="speed", xlabel="time [s]", ylabel="[mm/s]", ylim=(0, None))
for one, color in ((c, "0.75"), (sine, "0.55")):
    right.plot(*one.rollout().positions[0].T, color=color, linewidth=4)
right.plot(*turning.rollout().positions[0].T)
right.set(title="a C that turns into a sine", xlabel="x [mm]", aspect="equal")
plt.show()
