"""
An arm that follows a moving goal
=================================

Step by step, at 200 Hz, within the limits of every joint: the goal goes round, and the tip follows the movement
towards it.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme
from kineme import robots

u = np.linspace(0, 1, 150)
s = 10 * u**3 - 15 * u**4 + 6 * u**5
tip = np.column_stack((0.4 + 0 * s, 0.3 * s - 0.15, 0.3 + 0.06 * np.sin(2 * np.pi * s)))
primitive = kineme.DMP().learn([kineme.Trajectory(2.0 * u, tip)])

panda = robots.load("panda")
arm = robots.ArmController(panda, primitive.controller(0.005, duration=3.0))
goals, tips, joints = [], [], []
for k in range(1600):
    turn, rate = 0.003 * k, 0.6
    goal = [0.45, 0.25 * np.cos(turn), 0.4 + 0.12 * np.sin(turn)]
    moving = [0.0, -0.25 * rate * np.sin(turn), 0.12 * rate * np.cos(turn)]
    state = arm.step(goal=goal, goal_velocity=moving)
    goals.append(goal)
    tips.append(state.movement.position)
    joints.append(np.abs(state.velocities) / panda.velocity)
goals, tips = np.array(goals), np.array(tips)

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(8.5, 3.4))
left.plot(goals[:, 1], goals[:, 2], color="0.8", linewidth=5, label="goal")
left.plot(tips[:, 1], tips[:, 2], label="movement of the tip")
left.plot(*tips[0, 1:], "o", color="C0")
left.set(xlabel="y [m]", ylabel="z [m]", aspect="equal")
left.legend()
right.plot(0.005 * np.arange(1600), joints, linewidth=1, label=[f"joint {k + 1}" for k in range(7)])
right.axhline(1, color="black", linestyle="--", linewidth=1)
right.set(xlabel="time [s]", ylabel="velocity / limit", ylim=(0, 1.1), xlim=(0, 8))
right.legend(ncols=2, fontsize="small")
plt.show()
