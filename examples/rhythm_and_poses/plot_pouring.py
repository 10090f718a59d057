"""
Poses: a cup that is carried and turned
=======================================

A pose is a position and a unit quaternion. Both move under one phase, to a new place and a new orientation, and the
rotation stays a rotation all the way.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme
from kineme.orientation import PoseDMP, exp

u = np.linspace(0, 1, 120)
rise = 10 * u**3 - 15 * u**4 + 6 * u**5
carry = np.column_stack((0.4 * rise, 0.1 * np.sin(np.pi * rise), 0.15 * np.sin(np.pi * rise)))
tilt = exp(np.outer(np.clip(2 * rise - 1, 0, 1), [0.0, 1.9, 0.0]))  # upright at first, then poured
demo = kineme.Trajectory(2.0 * u, np.hstack((carry, tilt)))

primitive = PoseDMP().learn([demo])
goal = np.hstack(([0.35, 0.3, 0.05], exp(np.array([0.9, 1.4, 0.0]))))
paths = {"demonstrated": primitive.rollout(n_samples=9), "to a new pose": primitive.rollout(goal=goal, n_samples=9)}

# %%
# Each drawing of the cup is a pose; the arrow is where its opening points.
figure = plt.figure(figsize=(8, 3.8))
for k, (title, path) in enumerate(paths.items()):
    axes = figure.add_subplot(1, 2, k + 1, projection="3d")
    poses = path.poses[0]
    w, x, y, z = poses[:, 3:].T
    up = np.column_stack((2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x**2 + y**2)))
    axes.plot(*poses[:, :3].T, color="0.6", linewidth=1)
    for pose, direction, color in zip(poses, up, plt.cm.viridis(np.linspace(0, 0.9, 9)), strict=True):
        axes.quiver(*pose[:3], *(0.12 * direction), color=color, linewidth=2.5)
    axes.set(title=title, xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    axes.set(xlim=(0, 0.5), ylim=(-0.1, 0.4), zlim=(-0.1, 0.35))
    axes.locator_params(nbins=4)
plt.show()
