# Movements
from kineme.movements.channels.channel import Channel as Channel
from kineme.movements.trajectories.trajectory import MovementLike as MovementLike
from kineme.movements.trajectories.trajectory import MovementsLike as MovementsLike
from kineme.movements.preparation.glitches import RemoveGlitches as RemoveGlitches
from kineme.movements.preparation.perturbations import Perturbation as Perturbation
from kineme.movements.segmentation.segment import Segmentation as Segmentation

__all__: list[str]
