"""What stands between a policy and an environment: action chunks, and the interface of MP_PyTorch."""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor

from kineme.errors import SpecificationError, TrajectoryError
from kineme.torch.primitive import Primitive
from kineme.validation import check_number

_ROUNDING = 1e-3  # of a step: a time that is rounded to single precision is at its sample


class ActionChunk(torch.nn.Module):
    """The last layer of a policy that speaks weights: d (N + 1) numbers in, T actions out.

    The numbers are weights and goal of each dimension, ``w_1 ... w_N, g - x`` one dimension after the other, x being
    where the chunk begins: zeros are a chunk that stays there, if it begins at rest. T actions are smooth, begin at
    the position and velocity that are given, and have gradients.

    Parameters
    ----------
    primitive : Primitive
        What moves, for one chunk.
    scale : float, default 1.0
        What all numbers are multiplied by: about the size of a chunk, in the unit of the positions, so that a network's
        numbers are about 1.

    Attributes
    ----------
    n_outputs : int
        d (N + 1), how many numbers the network before it gives.

    Raises
    ------
    SpecificationError
        A primitive in the formulation "original" or "amplitude-scaled": with the goal at the start it cannot move.

    Examples
    --------
    >>> import kineme, torch
    >>> chunk = kineme.torch.ActionChunk(kineme.torch.Primitive(dims=7, n_weights=8, rate=50, duration=0.8))
    >>> policy = torch.nn.Sequential(torch.nn.Linear(32, 64), torch.nn.ReLU(), torch.nn.Linear(64, chunk.n_outputs))
    >>> chunk(policy(torch.zeros(16, 32)), position=torch.zeros(16, 7)).shape
    torch.Size([16, 41, 7])
    """

    def __init__(self, primitive: Primitive, scale: float = 1.0) -> None:
        super().__init__()
        check_number("scale", scale, above=0.0)
        if primitive.counts_per_distance:
            raise SpecificationError(
                'expected the formulation "bio-inspired" or "decoupled", got '
                f'"{primitive.dmp.formulation}", in which a chunk whose goal is its start cannot move'
            )
        self.primitive, self.scale = primitive, float(scale)

    @property
    def n_outputs(self) -> int:
        """Numbers that a network gives for one chunk."""
        return self.primitive.dims * (self.primitive.dmp.n_basis + 1)

    def forward(
        self,
        outputs: Tensor,
        position: Tensor,
        velocity: Tensor | None = None,
        *,
        derivative: int | tuple[int, ...] = 0,
    ) -> Any:
        """Actions (..., T, d), the first at the present; or their velocities or accelerations.

        Parameters
        ----------
        outputs : Tensor of shape (..., d (N + 1))
            Of a network.
        position : Tensor of shape (..., d)
            At the beginning of the chunk, in the user's unit.
        velocity : Tensor of shape (..., d), optional
            Then, per second; by default 0.
        derivative : {0, 1, 2} or tuple of these, default 0
            As in `Primitive.forward`.

        Raises
        ------
        TrajectoryError
            A tensor of another shape.
        """
        if outputs.shape[-1] != self.n_outputs:
            raise TrajectoryError(f"expected outputs (..., {self.n_outputs}), got {tuple(outputs.shape)}")
        numbers = self.scale * outputs.unflatten(-1, (self.primitive.dims, -1))
        velocity = torch.zeros_like(position) if velocity is None else velocity
        goal = position + numbers[..., -1]
        return self.primitive(numbers[..., :-1], position, goal, velocity=velocity, derivative=derivative)

    def encode(self, actions: Tensor) -> Tensor:
        """Outputs (..., d (N + 1)) whose chunks are nearest to demonstrated ones (..., T, d): what to train on.

        They belong to chunks that begin with the demonstrated velocity, ``primitive.initial_velocity(actions)``.

        Raises `TrajectoryError`: actions of another shape.
        """
        weights, goal = self.primitive.encode(actions)
        numbers = torch.cat((weights, (goal - actions[..., 0, :])[..., None]), dim=-1)
        return numbers.flatten(-2) / self.scale


class Trajectories:
    """A primitive behind the seven methods with which fancy_gym's black-box wrapper calls MP_PyTorch.

    It keeps what was set; the primitive does not. Parameters are ``w_1 ... w_N, g`` one dimension after the other. The
    samples are those after the initial time, to the end of the duration: fancy_gym executes one after the other.

    Parameters
    ----------
    primitive : Primitive
        What moves; its specification is used at the rate and for the duration that are set.
    low, high : float, default -inf and inf
        Bounds of every parameter.
    """

    phase_gn: Any = None  #: fancy_gym asks it for bounds of a learned tempo and delay, which there are none of

    def __init__(self, primitive: Primitive, low: float = -torch.inf, high: float = torch.inf) -> None:
        self._given = self._primitive = primitive
        self._n_params = primitive.dims * (primitive.dmp.n_basis + 1)
        self._bounds = (low, high)
        self.reset()

    def reset(self) -> None:
        """Forget parameters and state."""
        self._params: Tensor | None = None
        self._initial: tuple[Tensor, Tensor, Tensor] | None = None
        self._start: Tensor | None = None

    def set_params(self, params: Any) -> None:
        """Set weights and goal, (..., d (N + 1)), a tensor or an array.

        Raises `TrajectoryError`: another number of them.
        """
        self._params = self._tensor(params)
        if self._params.shape[-1] != self._n_params:
            raise TrajectoryError(f"expected {self._n_params} parameters, got {self._params.shape[-1]}")

    def set_initial_conditions(self, init_time: Any, init_pos: Any, init_vel: Any) -> None:
        """Set the state (..., d) from which the movement goes on at a time [s], the same for all of a batch.

        The first state after a reset is the start from which the shape counts.

        Raises `SpecificationError`: times that differ.
        """
        times = self._tensor(init_time).reshape(-1)
        if bool((times != times[0]).any()):
            raise SpecificationError(
                f"expected the same initial time for all of a batch, got {times.tolist()}; go on with each time apart"
            )
        self._initial = (times[0], self._tensor(init_pos), self._tensor(init_vel))
        self._start = self._initial[1] if self._start is None else self._start

    def set_duration(self, duration: float | None, dt: float) -> None:
        """Set duration and step between samples [s]; None is the primitive's own duration."""
        seconds = float(self._given.duration.max()) if duration is None else float(duration)
        n_steps = max(1, round(seconds / dt))
        if (self._primitive.n_samples - 1, float(self._primitive.duration.max())) != (n_steps, seconds):
            self._primitive = self._given.at_rate(n_steps / seconds, seconds)

    def get_traj_pos(self) -> Tensor:
        """Positions (..., k, d) after the initial time."""
        return self._rest(0)

    def get_traj_vel(self) -> Tensor:
        """Velocities (..., k, d) after the initial time, per second."""
        return self._rest(1)

    def get_params_bounds(self) -> Tensor:
        """Lower and upper bounds (2, d (N + 1))."""
        return self._tensor(self._bounds)[:, None].expand(2, self._n_params).clone()

    def _tensor(self, values: Any) -> Tensor:
        like = self._given.decode_matrix
        return torch.as_tensor(values, dtype=like.dtype, device=like.device)

    def _rest(self, derivative: int) -> Tensor:
        if self._params is None or self._initial is None:
            raise SpecificationError("expected set_params and set_initial_conditions before a trajectory is asked for")
        time, position, velocity = self._initial
        numbers = self._params.unflatten(-1, (self._given.dims, -1))
        path = self._primitive.replan(
            numbers[..., :-1], at=time, position=position, velocity=velocity, goal=numbers[..., -1], start=self._start,
            derivative=derivative,
        )  # fmt: skip
        steps = float(time / self._primitive.duration.max()) * (self._primitive.n_samples - 1)
        return path[..., math.floor(steps + _ROUNDING) + 1 :, :]
