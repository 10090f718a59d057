"""kineme: learn movements as Dynamical Movement Primitives, recognize them, name them, move again.

The names below load on first use, so that ``import kineme`` costs next to nothing.
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING as _TYPE_CHECKING
from typing import Any as _Any

__version__ = "0.1.0"

if _TYPE_CHECKING:
    from kineme import anchoring, control, datasets, kernels, orientation, styles
    from kineme.datasets.lasa import load_lasa
    from kineme.errors import (
        DataError,
        DegenerateMovementError,
        DegenerateMovementWarning,
        KinemeError,
        SpecificationError,
        TrajectoryError,
    )
    from kineme.features.dmp_features import DMPFeatures
    from kineme.features.rhythmic_features import RhythmicFeatures
    from kineme.files.recordings import read_recordings
    from kineme.library.library import ActionLibrary
    from kineme.movements.preparation.preprocess import preprocess
    from kineme.movements.preparation.resample import Resample
    from kineme.movements.preparation.smooth import Smooth
    from kineme.movements.preparation.trim import TrimRest
    from kineme.movements.segmentation.segment import segment
    from kineme.movements.trajectories.demonstrations import Demonstrations
    from kineme.movements.trajectories.trajectory import Trajectory
    from kineme.primitives.discrete.dmp import DMP
    from kineme.primitives.discrete.primitives import Primitives
    from kineme.primitives.rhythmic.primitives import RhythmicPrimitives
    from kineme.primitives.rhythmic.rhythmic_dmp import RhythmicDMP
    from kineme.recognition.recognizer import Recognizer

_HOME = {
    "Trajectory": "kineme.movements.trajectories.trajectory",
    "Demonstrations": "kineme.movements.trajectories.demonstrations",
    "segment": "kineme.movements.segmentation.segment",
    "preprocess": "kineme.movements.preparation.preprocess",
    "TrimRest": "kineme.movements.preparation.trim",
    "Smooth": "kineme.movements.preparation.smooth",
    "Resample": "kineme.movements.preparation.resample",
    "datasets": "kineme",
    "load_lasa": "kineme.datasets.lasa",
    "read_recordings": "kineme.files.recordings",
    "DMP": "kineme.primitives.discrete.dmp",
    "Primitives": "kineme.primitives.discrete.primitives",
    "control": "kineme",
    "RhythmicDMP": "kineme.primitives.rhythmic.rhythmic_dmp",
    "RhythmicPrimitives": "kineme.primitives.rhythmic.primitives",
    "DMPFeatures": "kineme.features.dmp_features",
    "RhythmicFeatures": "kineme.features.rhythmic_features",
    "Recognizer": "kineme.recognition.recognizer",
    "ActionLibrary": "kineme.library.library",
    "kernels": "kineme",
    "anchoring": "kineme",
    "styles": "kineme",
    "orientation": "kineme",
    "KinemeError": "kineme.errors",
    "TrajectoryError": "kineme.errors",
    "DegenerateMovementError": "kineme.errors",
    "SpecificationError": "kineme.errors",
    "DataError": "kineme.errors",
    "DegenerateMovementWarning": "kineme.errors",
}

__all__ = [  # noqa: RUF022 - in the order of the flow
    "Trajectory", "Demonstrations", "segment", "preprocess", "TrimRest", "Smooth", "Resample", "datasets", "load_lasa",
    "read_recordings",
    "DMP", "Primitives", "control", "RhythmicDMP", "RhythmicPrimitives", "orientation", "styles",
    "DMPFeatures", "RhythmicFeatures", "kernels", "Recognizer", "anchoring", "ActionLibrary",
    "KinemeError", "TrajectoryError", "DegenerateMovementError", "SpecificationError", "DataError",
    "DegenerateMovementWarning",
]  # fmt: skip


def __getattr__(name: str) -> _Any:
    if name not in _HOME:
        raise AttributeError(f"module 'kineme' has no attribute {name!r}; it has {', '.join(__all__)}")
    home = _HOME[name]
    value = _import_module(f"kineme.{name}") if home == "kineme" else getattr(_import_module(home), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
