# The table of public names, in the order of the flow; `kineme._lazy` loads from it, `docs/make_reference.py` prints it.

# Movements
from kineme.movements.trajectories.trajectory import Trajectory as Trajectory
from kineme.movements.trajectories.demonstrations import Demonstrations as Demonstrations
from kineme.movements.channels.channel import Channel as Channel
from kineme.movements.trajectories.trajectory import MovementLike as MovementLike
from kineme.movements.trajectories.trajectory import MovementsLike as MovementsLike
from kineme.movements.preparation.trim import preprocess as preprocess
from kineme.movements.preparation.trim import TrimRest as TrimRest
from kineme.movements.preparation.smooth import Smooth as Smooth
from kineme.movements.preparation.resample import Resample as Resample
from kineme.movements.preparation.perturbations import Perturbation as Perturbation
from kineme.movements.segmentation.segment import segment as segment
from kineme.movements.segmentation.segment import Segmentation as Segmentation

# Recordings in files, and data sets
from kineme.io.reading.recordings import read_recordings as read_recordings
from kineme.io.reading.recordings import read_recording as read_recording
from kineme.io.reading.merge_files import Recordings as Recordings
from kineme.io.writing.write_movement import write_movement as write_movement
from kineme import datasets as datasets
from kineme.datasets.lasa import load_lasa as load_lasa

# Primitives
from kineme.dmp.discrete.dmp import DMP as DMP
from kineme.dmp.discrete.dmp import Primitives as Primitives
from kineme.dmp.discrete.rollout import Rollout as Rollout
from kineme import control as control
from kineme.dmp.rhythmic.rhythmic_dmp import RhythmicDMP as RhythmicDMP
from kineme.dmp.rhythmic.rhythmic_dmp import RhythmicPrimitives as RhythmicPrimitives
from kineme import orientation as orientation
from kineme import styles as styles
from kineme.dmp.discrete.choose import BasisSelection as BasisSelection
from kineme.dmp.couple import couple as couple
from kineme.dmp.join import join as join
from kineme.dmp.join import blend as blend
from kineme.dmp.contextual import Contextual as Contextual
from kineme.dmp.improve import improve as improve
from kineme.dmp.improve import Improvement as Improvement

# Features and kernels
from kineme.features.movement_features import DMPFeatures as DMPFeatures
from kineme.features.movement_features import RhythmicFeatures as RhythmicFeatures
from kineme.features.random_binning import RandomBinning as RandomBinning
from kineme import kernels as kernels

# Recognition
from kineme.recognition.recognizer import Recognizer as Recognizer
from kineme.similarity.representation import Representation as Representation
from kineme.kernels.soft_rotation import RotationPrior as RotationPrior
from kineme.recognition.answer import Answer as Answer
from kineme.recognition.early.hypotheses import Early as Early
from kineme.recognition.early.stream import Live as Live
from kineme.recognition.early.live_state import LiveState as LiveState
from kineme.recognition.outliers import find_outliers as find_outliers
from kineme.recognition.outliers import Outlier as Outlier
from kineme.recognition.outliers import Outliers as Outliers
from kineme.recognition.recognizer import warm_up as warm_up

# Symbols and the action library
from kineme import anchoring as anchoring
from kineme import robots as robots
from kineme.library.library import ActionLibrary as ActionLibrary

# Errors and warnings
from kineme.errors import KinemeError as KinemeError
from kineme.errors import TrajectoryError as TrajectoryError
from kineme.errors import DegenerateMovementError as DegenerateMovementError
from kineme.errors import SpecificationError as SpecificationError
from kineme.errors import DataError as DataError
from kineme.errors import DegenerateMovementWarning as DegenerateMovementWarning
from kineme.errors import ExtrapolationWarning as ExtrapolationWarning

__version__: str
__all__: list[str]
