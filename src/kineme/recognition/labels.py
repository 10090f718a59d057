"""Labels of training movements."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import TrajectoryError
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.movements.trajectories.labels import label_array
from kineme.validation import describe


def check_labels(demos: Demonstrations, y: Any) -> NDArray[Any]:
    """Labels `y`, or those of the demonstrations: one per movement, texts or numbers, none of them empty.

    Raises
    ------
    TrajectoryError
        No labels, another number of them, an empty or missing one; the message names the movement.
    """
    labels = require_labels(demos) if y is None else label_array(y, len(demos), demos.names)
    for i, label in enumerate(labels.tolist()):
        if isinstance(label, (list, tuple, dict)) or (isinstance(label, str) and not label.strip()):
            raise TrajectoryError(
                f"{describe(i, demos.names)}: expected a label that is text or a number, got {label!r}; "
                "name the action, or leave the movement out"
            )
    try:
        np.sort(labels)
    except TypeError as error:
        raise TrajectoryError(
            f"expected labels that are texts or numbers, as classes have an order, got {error}"
        ) from None
    return labels
