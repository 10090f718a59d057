"""
A file with joints that wrap and a gripper
==========================================

Robots write tables: a clock, joint angles that jump from 180 to -180 degrees, a gripper that is open or closed.
Reading such a table needs no configuration, and says what it assumed.
"""

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

import kineme

u = np.linspace(0, 1, 160)
shoulder = 150 + 70 * (1 - np.cos(np.pi * u))  # beyond 180 degrees
elbow = 60 * np.sin(np.pi * u)
wrapped = (shoulder + 180) % 360 - 180
table = np.column_stack((1000 * 2 * u, wrapped, elbow, (u > 0.55) * 1.0))
path = Path(mkdtemp()) / "reach.csv"
np.savetxt(path, table, delimiter=",", header="time [ms],shoulder [deg],elbow [deg],gripper", comments="")

read = kineme.read_recordings(path)
for channel in read.demonstrations.channels:
    print(f"{channel.name}: {channel.kind}, unit {channel.unit}")

# %%
# What a primitive learns is continuous, and without the gripper, whose steps are kept beside it.
(movement,) = read.demonstrations
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 2.8), sharex=True)
left.plot(2 * u, table[:, 1:3], label=["shoulder", "elbow"])
left.step(2 * u, 100 * table[:, 3], where="post", label="gripper (100 = closed)")
left.set(title="in the file", ylabel="angle [°]", xlabel="time [s]")
again = kineme.DMP().learn(read).rollout(rate=50)
right.plot(movement.times, movement.positions, color="0.8", linewidth=5)
right.plot(again.times[0], again.positions[0], label=["shoulder", "elbow"])
right.set(title="what is learned, and replayed", xlabel="time [s]", xlim=(0, 2))
for axes in (left, right):
    axes.legend()
plt.show()
