"""The specification of a DMP for orientations and poses."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from kineme.dmp.discrete.dmp import DMP
from kineme.dmp.pose.pose_primitives import PosePrimitives
from kineme.dmp.pose.tangent import to_tangent
from kineme.dmp.recorded_as import recorded_as
from kineme.errors import SpecificationError
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements_like import MovementsLike


@dataclass(frozen=True)
class PoseDMP:
    """A DMP for orientations (w, x, y, z), or for positions and orientations under one canonical system.

    It learns poses, and recordings with any mixture of positions, joint angles and orientations, such as two hands. It
    is an ordinary DMP of the rotation vector from the goal, ``p = 2 log(q conj(q_goal))``, whose goal is 0; with
    the bio-inspired formulation, in normalized time,

        p'' = K (0 - p) - D p' + K f(s) + K s p_0,    q = exp(p) q_goal,    omega = J(p) p' / tau.

    The rates of p become angular velocities through the Jacobian J of the logarithm: the corrected formulation of
    Koutras and Doulgeri, "A correct formulation for the orientation dynamic movement primitives for robot control in
    the Cartesian space", PMLR 100, 2020. Ude et al. (ICRA 2014) take p' for omega, and the fast spring then oscillates.

    Parameters
    ----------
    dmp : DMP, default DMP()
        The specification for all 3 or 6 dimensions. Its preprocessing applies to positions and rotation vectors; a
        step that measures distances over all dimensions counts a radian as a unit of length.

    Notes
    -----
    What a new goal preserves: start and goal multiplied from the right by one quaternion (a tool mounted
    differently) give the demonstrated angular velocities exactly. A new goal alone keeps f, along the axes of the
    world, and bends the path by the turn that is added or missing, as a new goal does to a position. Start and goal
    multiplied from the left (the whole scene turned) do not turn f with them.

    The original formulation scales each axis of p by itself: a demonstration that does not turn about the world's x
    cannot be moved to a goal that needs it.

    Turns of more than pi are followed, up to a full turn from the goal, beyond it about a fixed axis. A generated path
    may leave that range; it stays smooth.

    Examples
    --------
    >>> import numpy as np
    >>> from kineme.orientation import PoseDMP, exp, slerp
    >>> u = np.linspace(0, 1, 101)
    >>> demo = slerp([1, 0, 0, 0], exp([0, 0, 1.5]), u**3 * (10 - 15 * u + 6 * u**2))
    >>> primitives = PoseDMP().learn([demo])
    >>> movement = primitives.rollout(goal=exp([0.5, 0, 2.0]), duration=2.0, rate=100)
    >>> movement.orientations.shape, movement.angular_velocities.shape
    ((1, 201, 4), (1, 201, 3))
    """

    dmp: DMP = field(default_factory=DMP)

    def __post_init__(self) -> None:
        if not isinstance(self.dmp, DMP):
            raise SpecificationError(f"expected dmp to be a kineme.DMP, got {self.dmp!r}; write PoseDMP(kineme.DMP())")

    def learn(self, movements: MovementsLike) -> PosePrimitives:
        """Learn one primitive per movement of 4 (orientation) or 7 columns (position, orientation), all at once.

        Movements with `channels` may have any number of positions, angles and orientations, at least one of these.

        Parameters
        ----------
        movements : Demonstrations, Trajectory, sequence of Trajectory or of (T_i, d) arrays, or (n, T, d) array
            Any lengths, any sampling; quaternions (w, x, y, z) of either sign.

        Raises
        ------
        TrajectoryError
            Movements that cannot be used; see `to_tangent` and `DMP.learn`.
        SpecificationError
            Poses with the amplitude-scaled formulation: it has one scale for all dimensions, and no distance from
            start to goal is common to meters and radians.
        """
        recorded = Demonstrations.of(movements)
        tangent, references = to_tangent(recorded, self.dmp.preprocessing)
        if self.dmp.formulation == "amplitude-scaled" and tangent.n_dims > 3:
            raise SpecificationError(
                'expected the formulation "bio-inspired" or "original" for poses, got "amplitude-scaled", which scales '
                "by one distance over meters and radians; learn positions and orientations apart to use it"
            )
        about = recorded_as(recorded, self.dmp.preprocessing)
        return PosePrimitives(
            replace(self.dmp, preprocessing=()).learn(tangent),
            references,
            about if about is not None and about.orientations else None,
        )
