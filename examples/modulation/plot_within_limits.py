"""
Within limits, and as fast as they allow
========================================

A path that would leave its limits is bent by the smoothest change that keeps it inside, and the least duration within
limits of velocity and acceleration is known in closed form.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

primitive = kineme.DMP().learn(kineme.load_lasa(["GShape"])[:1])
plain = primitive.rollout()
low, high = [-17.0, -18.0], [20.0, np.inf]
inside = primitive.rollout(position_limits=(low, high))

least = inside.least_duration(velocity=50.0, acceleration=200.0)
print(f"{least[0]:.2f} s instead of {primitive.durations[0]:.2f} s")

# %%
fastest = primitive.rollout(duration=least, position_limits=(low, high))
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
left.plot(*plain.positions[0].T, color="0.8", linewidth=5, label="as demonstrated")
left.plot(*inside.positions[0].T, label="within limits")
left.axvspan(-32, low[0], color="C1", alpha=0.15, linewidth=0)
left.axhspan(-30, low[1], color="C1", alpha=0.15, linewidth=0)
left.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", xlim=(-32, 25), ylim=(-30, 20))
right.plot(fastest.times[0], np.abs(fastest.accelerations[0]), label=["|x''|", "|y''|"])
right.axhline(200.0, color="C2", linestyle="--", label="limit")
right.set(xlabel="time [s]", ylabel="acceleration [mm/s²]", ylim=(0, 240))
right.legend(loc="upper right", ncols=3)
figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=2)
plt.show()
