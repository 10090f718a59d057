# The table of public names, in the order of the flow; `kineme._lazy` loads from it, `docs/make_reference.py` prints it.

# Movements
from kineme.movements.trajectories.trajectory import Trajectory as Trajectory
from kineme.movements.trajectories.demonstrations import Demonstrations as Demonstrations
from kineme.movements.preparation.trim import preprocess as preprocess
from kineme.movements.preparation.trim import TrimRest as TrimRest
from kineme.movements.preparation.smooth import Smooth as Smooth
from kineme.movements.preparation.resample import Resample as Resample
from kineme.movements.segmentation.segment import segment as segment
from kineme import movements as movements

# Recordings in files, and data sets
from kineme.io.reading.recordings import read_recordings as read_recordings
from kineme.io.reading.recordings import read_recording as read_recording
from kineme.io.writing.write_movement import write_movement as write_movement
from kineme import datasets as datasets
from kineme.datasets.lasa import load_lasa as load_lasa
from kineme import io as io

# Primitives
from kineme.dmp.discrete.dmp import DMP as DMP
from kineme import control as control
from kineme.dmp.rhythmic.rhythmic_dmp import RhythmicDMP as RhythmicDMP
from kineme import orientation as orientation
from kineme import styles as styles
from kineme.dmp.join import couple as couple
from kineme.dmp.join import join as join
from kineme.dmp.join import blend as blend
from kineme.dmp.improve import improve as improve
from kineme import dmp as dmp

# Features and kernels
from kineme.features.movement_features import DMPFeatures as DMPFeatures
from kineme.features.movement_features import RhythmicFeatures as RhythmicFeatures
from kineme import kernels as kernels

# Recognition
from kineme.recognition.recognizer import Recognizer as Recognizer
from kineme.recognition.outliers import find_outliers as find_outliers
from kineme.recognition.recognizer import warm_up as warm_up
from kineme import recognition as recognition

# Symbols and the action library
from kineme import anchoring as anchoring
from kineme import robots as robots
from kineme.library.library import ActionLibrary as ActionLibrary

# Errors and warnings
from kineme import errors as errors

__version__: str
__all__: list[str]
