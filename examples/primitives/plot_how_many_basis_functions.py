"""
How many basis functions?
=========================

Too few cut corners, too many follow the noise. `DMP.choose` predicts each sample from all the others, for every
number and every ridge, and takes the fewest that are good enough.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

clean = kineme.load_lasa(["NShape"])
rng = np.random.default_rng(0)
every = slice(None, None, 10)
noisy = [kineme.Trajectory(one.times[every], one.positions[every] + rng.normal(size=(100, 2))) for one in clean]

selection = kineme.DMP().choose(noisy)
print(f"{selection.dmp.n_basis} basis functions, ridge {selection.dmp.ridge:g}: {100 * selection.error:.2f} %")

# %%
figure, panels = plt.subplots(1, 3, figsize=(9, 3), sharex=True, sharey=True, layout="constrained")
for axes, n in zip(panels, (6, selection.dmp.n_basis, 95), strict=True):
    dmp = selection.dmp if n == selection.dmp.n_basis else kineme.DMP(n_basis=n, ridge=1e-12)
    path = dmp.learn(noisy[:1]).rollout().positions[0]
    axes.plot(*noisy[0].positions.T, ".", color="0.6", markersize=4, label="recorded, 1 mm of noise")
    axes.plot(*clean[0].positions.T, color="0.8", linewidth=6, zorder=0, label="without the noise")
    axes.plot(*path.T, color="C0", label="learned")
    chosen = " (chosen)" if dmp is selection.dmp else ""
    axes.set(title=f"{n} basis functions{chosen}", xlabel="x [mm]", aspect="equal")
panels[0].set_ylabel("y [mm]")
figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
plt.show()
