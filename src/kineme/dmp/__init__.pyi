# Primitives
from kineme.dmp.discrete.dmp import Primitives as Primitives
from kineme.dmp.discrete.rollout import Rollout as Rollout
from kineme.dmp.rhythmic.rhythmic_dmp import RhythmicPrimitives as RhythmicPrimitives
from kineme.dmp.discrete.encode import BasisSelection as BasisSelection
from kineme.dmp.contextual import Contextual as Contextual
from kineme.dmp.improve import Improvement as Improvement

# Out of Python
from kineme.dmp.export_c import c_header as c_header
from kineme.dmp.export_onnx import onnx_model as onnx_model

__all__: list[str]
