"""
Unknown is an answer
====================

Thirteen shapes are known, thirteen others were never shown. Each answer says how usual a movement is among those of
known shapes, and below the error rate it is called unknown.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

demos = kineme.load_lasa()
known, strange = demos[:91], demos[91:]
varied = kineme.movements.Perturbation(rotation=np.radians(20), warp=0.35, noise=0.01)
train = np.arange(91) % 7 < 5  # five demonstrations of each known shape
recognizer = kineme.Recognizer().fit(varied.apply(known[train], 0))

tests = [varied.apply(known[~train], seed) for seed in range(1, 6)]
usual = [answer.p_known for test in tests for answer in recognizer.recognize(test)]
unusual = [answer.p_known for answer in recognizer.recognize(varied.apply(strange, 6))]
print(f"known called unknown: {np.mean(np.array(usual) <= 0.05):.0%}")
print(f"unknown called unknown: {np.mean(np.array(unusual) <= 0.05):.0%}")

# %%
# The p-values of known movements are spread evenly from 0 to 1, which is what they promise: about one in twenty is
# called unknown at an error rate of 0.05. Those of the others pile up at 0.
figure, axes = plt.subplots(figsize=(6.4, 3.2))
bins = np.linspace(0, 1, 21)
shares = [np.full(len(p), 1 / len(p)) for p in (usual, unusual)]
axes.hist([usual, unusual], bins, weights=shares, label=["of known shapes", "of unknown shapes"])
axes.axvline(0.05, color="black", linestyle="--", linewidth=1)
axes.annotate("called unknown", (0.05, 0.7), (0.15, 0.7), arrowprops={"arrowstyle": "->"}, va="center", fontsize=8)
axes.set(xlabel="p_known: share of known movements that are as novel", ylabel="share of the movements", xlim=(0, 1))
axes.legend()
plt.show()
