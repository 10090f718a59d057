"""
A library as one HTML file
==========================

``kineme page`` writes a library as a page that recognizes what is drawn on it and moves on, in any browser, without
server and network. It can be sent to anyone: here is what it weighs.
"""

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt

import kineme
from kineme.studio.page.write_page import write_page

folder = Path(mkdtemp())
library = kineme.ActionLibrary(folder / "handwriting", create=True)
library.learn(kineme.load_lasa())
counts = (26, 52, 104, 182)
pages = [folder / f"{most}.html" for most in counts]
for most, page in zip(counts, pages, strict=True):
    write_page(page, library, most=most)
library.close()
sizes = [page.stat().st_size / 1e3 for page in pages]
for most, size in zip(counts, sizes, strict=True):
    print(f"{most:4d} movements: {size:5.0f} kB")

# %%
# The script and the style are the same in all of them; the rest is numbers. A movement of each symbol is enough to
# draw with; more make the answer surer.
held = pages[0].read_text(encoding="utf-8").partition('id="snapshot">')[2].partition("</script>")[0]
fixed = sizes[0] - len(held.encode()) / 1e3
figure, axes = plt.subplots(figsize=(6.4, 3), layout="constrained")
names = [str(most) for most in counts]
axes.barh(names, sizes, color="C0", label="movements and primitives")
axes.barh(names, fixed, color="0.6", label="script and style")
axes.set(xlabel="size of the page [kB]", ylabel="movements in it")
axes.spines[["top", "right"]].set_visible(False)
axes.legend()
plt.show()
