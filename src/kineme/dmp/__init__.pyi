# Primitives
from kineme.dmp.discrete.dmp import Primitives as Primitives
from kineme.dmp.discrete.rollout import Rollout as Rollout
from kineme.dmp.rhythmic.rhythmic_dmp import RhythmicPrimitives as RhythmicPrimitives
from kineme.dmp.discrete.encode import BasisSelection as BasisSelection
from kineme.dmp.contextual import Contextual as Contextual
from kineme.dmp.improve import Improvement as Improvement

__all__: list[str]
