"""
A handwritten shape on a real arm's joints
==========================================

A movement of the tip becomes joint positions, velocities and accelerations of a Panda, with every limit checked
before anything moves. Too fast for the arm, it is slowed down as a whole.
"""

import numpy as np

import kineme
from kineme import robots

shape = kineme.load_lasa(["Sharpc"])[0]
drawn = 0.004 * (shape.positions - shape.positions.mean(axis=0))  # 20 cm, in meters
tip = np.column_stack((np.full(len(drawn), 0.5), drawn[:, 0], drawn[:, 1] + 0.45))
primitive = kineme.DMP().learn([kineme.Trajectory(0.3 * shape.times, tip)])

panda = robots.load("panda")
made = robots.move(primitive.rollout(rate=100), panda, timing="slowed")
print(f"slowed {made.factor:.2f} times, all checks passed: {made.preflight.passed}")

# %%
# The path of the tip, wanted and executed, and the joints beside their limits; the approach from rest is shaded.
# `figure.savefig` keeps the picture.
figure = robots.draw_robot_movement(made)
