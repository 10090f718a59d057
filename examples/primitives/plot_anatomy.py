r"""
What is inside of a primitive
=============================

A spring pulls to the goal, a damper keeps it from swinging, and a forcing term bends the way there. The forcing term
is a weighted sum of bumps over a phase that decays from 1 to almost 0:

.. math:: f(s) = \frac{\sum_i \psi_i(s)\, w_i}{\sum_i \psi_i(s)}, \qquad \tau \dot s = -\alpha s
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

dmp = kineme.DMP(n_basis=12)
demo = kineme.load_lasa(["Sine"])[:1]
primitive = dmp.learn(demo)
u = np.linspace(0, 1, 200)

# %%
# `Psi` has one column for each basis function; with the weights it gives the forcing term, and with the spring the
# path.
Psi = dmp.basis.design(u)
forcing = Psi @ primitive.weights[0, :, 1]
figure, (left, middle, right) = plt.subplots(1, 3, figsize=(9, 2.8))
left.plot(u, Psi, linewidth=1)
left.plot(u, dmp.basis.phase(u), color="black", linestyle="--", label="phase s")
left.set(title="basis functions over a decaying phase", xlabel="time / duration")
left.legend()
for weight, bump in zip(primitive.weights[0, :, 1], Psi.T, strict=True):
    middle.fill_between(u, weight * bump, alpha=0.4, linewidth=0)
middle.plot(u, forcing, color="black", label="f")
middle.set(title="weighted, they add up to the forcing term", xlabel="time / duration", ylabel="f [mm]")
middle.legend()
right.plot(u, demo[0].positions[np.linspace(0, 999, 200).astype(int), 1], color="0.8", linewidth=6, label="shown")
right.plot(u, primitive.rollout().positions[0, :, 1], label="moved again")
alone = kineme.dmp.Primitives(**{**vars(primitive), "scaled_weights": 0 * primitive.scaled_weights})
right.plot(u, alone.rollout(velocity=[0, 0]).positions[0, :, 1], "--", label="spring alone")
right.set(title="which bends the way to the goal", xlabel="time / duration", ylabel="y [mm]")
right.legend()
plt.show()
