"""`Draw` and `Move`: the page of a snapshot in a cell of a notebook.

Each widget shows one page, which computes by itself in a frame of its own: it goes on recognizing and moving where a
notebook was exported with its widgets, and no kernel answers.
"""

from __future__ import annotations

from typing import Any

import anywidget
import numpy as np
import traitlets
from numpy.typing import ArrayLike

from kineme.dmp.discrete.dmp import Primitives
from kineme.errors import DataError, SpecificationError, TrajectoryError
from kineme.library.library import ActionLibrary
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.answer import Answer
from kineme.recognition.recognizer import Recognizer
from kineme.similarity.describe import N_POINTS
from kineme.studio.page.write_page import FOLDER, check_drawable, filled_page, page_of
from kineme.studio.snapshot import DRAWN, movement_parts, snapshot_of_library, snapshot_of_recognizer
from kineme.validation import Array, check_number

_MOST = 100  # primitives of one widget


class _Page(anywidget.AnyWidget):
    """A page in a frame, its title for who does not see it, and what it tells of drawings and of what moves."""

    _esm = (FOLDER / "notebook.js").read_text(encoding="utf-8")
    _page = traitlets.Unicode().tag(sync=True)
    _title = traitlets.Unicode().tag(sync=True)
    drawn: Any = traitlets.List().tag(sync=True)
    moved: Any = traitlets.Dict().tag(sync=True)

    def _moving(self, part: str) -> Array:
        if not self.moved:
            raise DataError("expected a movement in the cell, got none yet; choose or draw one there first")
        return np.array(self.moved[part], dtype=float)

    @property
    def start(self) -> Array:
        """Where the movement in the cell starts, (d,)."""
        return self._moving("start")

    @property
    def goal(self) -> Array:
        """Where the movement in the cell ends, (d,), as it was dragged last."""
        return self._moving("goal")

    @property
    def path(self) -> Trajectory:
        """The movement in the cell."""
        return Trajectory(self._moving("times"), self._moving("positions"), self.moved["name"])


class Draw(_Page):
    """Draw movements in a cell.

    Without a recognizer, each movement gets the name that stands in the field below the drawing area. With one, each is
    recognized while it is drawn, and can be dragged afterwards, see `Move`.

    Parameters
    ----------
    recognizer : Recognizer or ActionLibrary, optional
        What recognizes the movements: fitted, or with symbols.
    height : float, default 1.0
        Height of the drawing area in the unit of the movements; the lower left corner is the origin. With a recognizer
        movements are as large as those that it has.
    most : int, optional
        Take at most so many movements of a library; by default as many as fit into 2 MB.

    Attributes
    ----------
    drawn : list
        A name, or None, and samples (time [s] and coordinates) of each movement, as the page writes them;
        ``draw.observe(act, "drawn")`` calls a function after each.
    moved : dict
        As of `Move`, with a recognizer.

    Raises
    ------
    SpecificationError
        A recognizer of movements that cannot be drawn, or one that the page does not have.
    """

    def __init__(
        self, recognizer: Recognizer | ActionLibrary | None = None, *, height: float = 1.0, most: int | None = None
    ) -> None:
        check_number("height", height, above=0)
        self.recognizer, self.height = recognizer, height
        if recognizer is None:
            page = filled_page("drawing.html", "drawing.js", {"frame": "notebook"})
        else:
            if isinstance(recognizer, ActionLibrary):
                snapshot = snapshot_of_library(recognizer, most, DRAWN)
                check_drawable(snapshot.header["comparison"]["n_dims"])
            else:
                check_drawable(recognizer.n_dims_)
                snapshot = snapshot_of_recognizer(recognizer, early=DRAWN)
            page = page_of(snapshot, "Draw movements", "notebook")
        super().__init__(_page=page, _title="Draw movements")

    @property
    def trajectories(self) -> list[Trajectory]:
        """All movements that were drawn, each with its name as label."""
        size = self.height if self.recognizer is None else 1.0
        arrays = [(name, np.array(samples, dtype=float)) for name, samples in self.drawn]
        return [Trajectory(samples[:, 0], size * samples[:, 1:], name) for name, samples in arrays]

    @property
    def trajectory(self) -> Trajectory:
        """The movement that was drawn last.

        Raises `DataError`: nothing was drawn yet.
        """
        if not self.drawn:
            raise DataError("expected a movement, got none yet; draw one in the cell of the widget first")
        return self.trajectories[-1]

    @property
    def answer(self) -> Answer:
        """The recognizer's answer to the movement that was drawn last.

        Raises `DataError`: nothing was drawn yet. Raises `SpecificationError`: a widget without a recognizer.
        """
        if self.recognizer is None:
            raise SpecificationError(
                "expected a recognizer that answers, got none; make the widget with Draw(recognizer)"
            )
        return self.recognizer.recognize(self.trajectory)

    def clear(self) -> None:
        """Forget what was drawn."""
        self.drawn = []


class Move(_Page):
    """Drag start and goal of primitives in a cell, or their path through via points.

    Parameters
    ----------
    primitives : Primitives
        What `kineme.DMP.learn` returns, at most 100, of positions in the plane or in space. Of several, one is chosen
        in the cell.

    Attributes
    ----------
    moved : dict
        ``name``, ``start``, ``goal``, ``via`` (pairs of a share of the duration and a point), ``times`` and
        ``positions`` of the movement in the cell, renewed when a hand lets go; ``move.observe(act, "moved")`` calls a
        function each time.

    Raises
    ------
    SpecificationError
        Too many primitives, or such whose columns are no positions in the plane or in space.
    """

    def __init__(self, primitives: Primitives) -> None:
        check_drawable(primitives.n_dims)
        if len(primitives) > _MOST or any(channel.kind != "position" for channel in primitives.channels or ()):
            raise SpecificationError(
                f"expected at most {_MOST} primitives whose columns are positions, got {primitives!r}; choose some, as "
                "in primitives[:100], or learn other columns"
            )
        self.primitives = primitives
        names = primitives.names if primitives.labels is None else primitives.labels
        self._names = ["movement"] * len(primitives) if names is None else list(map(str, names))
        if len(set(self._names)) < len(primitives):
            self._names = [f"{k + 1} {name}" for k, name in enumerate(self._names)]
        rollout = primitives.rollout(n_samples=N_POINTS)
        snapshot = movement_parts(primitives, learns=False)
        snapshot.header.update(
            n_movements=len(primitives),
            classes=self._names,
            comparison={"n_dims": primitives.n_dims, "translation": False},
        )
        snapshot.arrays["paths"] = np.asarray(rollout.positions.transpose(0, 2, 1), dtype=np.float32)
        first = {"name": self._names[0], "via": [], "times": rollout.times[0].tolist()}
        first |= {"start": primitives.starts[0].tolist(), "goal": primitives.goals[0].tolist()}
        title = "Drag start and goal of a movement"
        page = page_of(snapshot, title, "notebook moves")
        super().__init__(_page=page, _title=title, moved=first | {"positions": rollout.positions[0].tolist()})

    @property
    def primitive(self) -> Primitives:
        """The primitive that is chosen in the cell."""
        return self.primitives[self._names.index(self.moved["name"])]

    @property
    def path(self) -> Trajectory:
        """The movement in the cell, with the label and the name of its primitive."""
        labels, names = self.primitive.labels, self.primitive.names
        label, name = None if labels is None else labels.tolist()[0], None if names is None else names[0]
        return Trajectory(self._moving("times"), self._moving("positions"), label, name)

    def place(self, *, start: ArrayLike | None = None, goal: ArrayLike | None = None) -> None:
        """Put the start or the goal (d,) elsewhere, as a hand does in the cell, which shows it; via points stay.

        Raises what `Primitives.rollout` raises, and then changes nothing.
        """
        start, goal = (self.start if start is None else start), (self.goal if goal is None else goal)
        via = list(map(tuple, self.moved["via"])) or None
        rollout = self.primitive.rollout(start=start, goal=goal, via=via, n_samples=N_POINTS)
        if len(rollout) != 1:
            raise TrajectoryError(f"expected a start and a goal of one movement, got {len(rollout)} of them")
        place = {"start": np.ravel(start).astype(float), "goal": np.ravel(goal).astype(float)}
        place |= {"times": rollout.times[0], "positions": rollout.positions[0]}
        self.moved = self.moved | {name: array.tolist() for name, array in place.items()}
