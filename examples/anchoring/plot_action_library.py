"""
A library that learns, forgets nothing, and moves
=================================================

An action library is one database in a folder: recordings, primitives and symbols, with every version. It recognizes,
says when it does not know, and moves again.
"""

from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

import kineme

demos = kineme.load_lasa(["Angle", "CShape", "Sine", "Spoon"])
library = kineme.ActionLibrary(mkdtemp(), create=True)
library.learn(demos[np.arange(28) % 7 < 5])
library.rename("Sine", "wave")
print(library.recognize(demos[19]).label, library.recognize(kineme.load_lasa(["Khamesh"])[0]).label)

# %%
# New movements without labels join the symbols that they are recognized as; a wrong step is taken back as a new
# version.
library.learn(kineme.Demonstrations.from_arrays([one.positions for one in demos[np.arange(28) % 7 >= 5]]))
print(library.join())
library.delete("Angle")
library.undo()
for version in library.history():
    print(version.id, version.action)

# %%
# Each symbol moves again, here to a goal 20 mm higher.
figure, row = plt.subplots(1, 4, figsize=(9, 2.6))
for axes, symbol in zip(row, library.symbols(), strict=True):
    for movement in library.movements(symbol.name):
        axes.plot(*movement.positions.T, color="0.75", linewidth=1)
    primitive = library.primitives(symbol.name)[0]
    path = primitive.rollout(goal=primitive.goals + np.array([0.0, 20.0])).positions[0]
    axes.plot(*path.T)
    axes.plot(*path[-1], "*", color="black", markersize=8)
    axes.set(title=f"{symbol.name}: {len(library.ids(symbol.name))} movements", aspect="equal", adjustable="datalim")
    axes.axis("off")
library.close()
plt.show()
