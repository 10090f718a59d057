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
    from kineme.io.recordings import read_recordings
    from kineme.library.library import ActionLibrary
    from kineme.primitives.dmp import DMP
    from kineme.primitives.primitives import Primitives
    from kineme.recognition.recognizer import Recognizer
    from kineme.rhythm.primitives import RhythmicPrimitives
    from kineme.rhythm.rhythmic_dmp import RhythmicDMP
    from kineme.segmentation.segment import segment
    from kineme.trajectories.demonstrations import Demonstrations
    from kineme.trajectories.preprocess import preprocess
    from kineme.trajectories.resample import Resample
    from kineme.trajectories.smooth import Smooth
    from kineme.trajectories.trajectory import Trajectory
    from kineme.trajectories.trim import TrimRest

_HOME = {
    "Trajectory": "kineme.trajectories.trajectory",
    "Demonstrations": "kineme.trajectories.demonstrations",
    "segment": "kineme.segmentation.segment",
    "preprocess": "kineme.trajectories.preprocess",
    "TrimRest": "kineme.trajectories.trim",
    "Smooth": "kineme.trajectories.smooth",
    "Resample": "kineme.trajectories.resample",
    "datasets": "kineme",
    "load_lasa": "kineme.datasets.lasa",
    "read_recordings": "kineme.io.recordings",
    "DMP": "kineme.primitives.dmp",
    "Primitives": "kineme.primitives.primitives",
    "control": "kineme",
    "RhythmicDMP": "kineme.rhythm.rhythmic_dmp",
    "RhythmicPrimitives": "kineme.rhythm.primitives",
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
