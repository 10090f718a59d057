"""`Primitive`: a specification of `kineme.DMP` as matrices of PyTorch.

With W = scale w and u = t / tau, positions are ``x0 + Phi W + b_g (g - x0) + b_v tau v0``, and weights are
``w = E (x - x0) / scale``; the matrices are those of `kineme.dmp.discrete.operators`. Since the system is linear, a
movement that is at (x, v) at time a goes on as

    z(u) = z_f(u) + exp(A (u - a)) ((x - x0, tau v) - z_f(a)),        A = [[0, 1], [-K, -D]],

where z_f is the response to weights and goal alone, from rest. That is exact at any a, so that replanning is continuous
in position and velocity (the use that ProDMP has: G. Li, Z. Jin, M. Volpp, F. Otto, R. Lioutikov, G. Neumann, "ProDMP:
A Unified Perspective on Dynamic and Probabilistic Movement Primitives", RA-L 8(4), 2023).
"""

from __future__ import annotations

import math
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.discrete.operators import decoder, encoder
from kineme.dmp.discrete.rollout import samples_at_rate
from kineme.dmp.discrete.specification import CLOSED
from kineme.dmp.spring_damper import NODE_WEIGHTS, NODES
from kineme.errors import DegenerateMovementError, SpecificationError, TrajectoryError
from kineme.validation import check_count, check_number, check_samples, describe

_LEARNED = ("weights", "start", "goal", "velocity")


class Primitive(torch.nn.Module):
    """A movement primitive as a module without parameters: a pure function of weights, start, goal and velocity.

    All functions are differentiable, take any batch shape ``...`` in front, which broadcasts, and work inside
    `torch.func.vmap`, `torch.func.jacrev`, `torch.compile` and `torch.export`. Their values are not looked at: NaN
    in, NaN out. Numbers are those of `kineme.DMP`, whatever the device.

    Parameters
    ----------
    dims : int
        Dimensions d of the movements.
    n_weights : int, default 25
        Number N of basis functions for each dimension.
    rate : float, default 100.0
        Samples per second, at least: there are ``T = ceil(rate * duration) + 1``.
    duration : float, default 1.0
        tau [s].
    dtype : torch.dtype, optional
        By default that of PyTorch. Matrices are computed in double precision, also after ``.double()``.
    device : torch.device, optional
    **specification
        Further parameters of `kineme.DMP`, as ``formulation="original"`` or ``stiffness=200.0``.

    Attributes
    ----------
    dmp : kineme.DMP
        The specification.
    duration : Tensor of shape () or (n,)
        tau [s].
    weights, start, goal, velocity : Tensor or None
        Those of learned primitives, (n, d, N) and (n, d); see `of`.
    decode_matrix : Tensor of shape (3, N + 3, T)
        From ``[w, g - x0, tau v0, x0]`` to positions, and to their first two derivatives in u; w is times the distance
        where weights count per distance.
    encode_matrix : Tensor of shape (T, N)
        From positions less x0 to w; to w times the distance where weights count per distance.

    Raises
    ------
    SpecificationError
        A parameter out of its range.

    Notes
    -----
    Weights are w of Eq. (2), (..., d, N): ``primitives.weights`` transposed. In the formulations "bio-inspired" and
    "decoupled" they are in the unit of the positions. In "original" they count per distance g - x0 of their dimension,
    in "amplitude-scaled" per distance |g - x0| in space: there they are ``primitives.weights`` over the learned
    distance, so that shapes grow with the distance as the formulation has it.
    """

    decode_matrix: Tensor
    encode_matrix: Tensor
    duration: Tensor
    weights: Tensor | None
    start: Tensor | None
    goal: Tensor | None
    velocity: Tensor | None

    def __init__(
        self,
        dims: int,
        n_weights: int = 25,
        *,
        rate: float = 100.0,
        duration: float = 1.0,
        dtype: torch.dtype | None = None,
        device: torch.device | str | None = None,
        **specification: Any,
    ) -> None:
        super().__init__()
        check_number("duration", duration, above=0.0)
        dmp = DMP(n_basis=n_weights, **specification)
        n_samples = samples_at_rate(rate, np.array([duration]), dmp)
        self._prepare(dmp, check_count("dims", dims, 1), n_samples, {}, np.array(float(duration)), dtype, device)

    @classmethod
    def of(
        cls,
        primitives: Primitives,
        *,
        n_samples: int | None = None,
        dtype: torch.dtype | None = None,
        device: torch.device | str | None = None,
    ) -> Self:
        """Learned primitives as a module, which moves as they do: ``Primitive.of(primitives)(goal=g)``.

        What is not given to its functions is as demonstrated, `duration` too; one primitive can have many goals.

        Parameters
        ----------
        primitives : Primitives
            Learned by a `kineme.DMP`.
        n_samples : int, optional
            Samples T of each movement; by default the specification's `n_points`.
        dtype, device : optional
            As for the class.

        Raises
        ------
        SpecificationError
            Other primitives, such as rhythmic ones.
        DegenerateMovementError
            In the formulation "original", where ``g = x0`` in a dimension; in "amplitude-scaled", a closed movement.
        """
        if not isinstance(primitives, Primitives):
            raise SpecificationError(f"expected primitives of kineme.DMP, got {type(primitives).__name__}")
        dmp = primitives.dmp
        n_samples = dmp.n_points if n_samples is None else check_count("n_samples", n_samples, 2)
        weights = primitives.weights.transpose(0, 2, 1)
        if dmp.formulation == "amplitude-scaled":
            weights = weights / _distances(primitives)
        learned = weights, primitives.starts, primitives.goals, primitives.velocities
        n_samples = check_samples(n_samples, dmp.n_basis, "n_samples")
        named = {name: torch.tensor(values) for name, values in zip(_LEARNED, learned, strict=True)}
        return cls._new(dmp, primitives.n_dims, n_samples, named, primitives.durations, dtype, device)

    @classmethod
    def _new(cls, *prepared: Any) -> Self:
        module = cls.__new__(cls)
        torch.nn.Module.__init__(module)
        module._prepare(*prepared)
        return module

    def _prepare(  # noqa: PLR0913, PLR0917 - two constructors share it
        self,
        dmp: DMP,
        dims: int,
        n_samples: int,
        learned: dict[str, Tensor],
        duration: Any,
        dtype: torch.dtype | None,
        device: torch.device | str | None,
    ) -> None:
        self.dmp, self.dims, self.n_samples = dmp, dims, n_samples
        self._K, self._D, self._alpha = dmp.K, dmp.D, dmp.basis.phase.alpha
        dtype = torch.get_default_dtype() if dtype is None else dtype
        for name, values in self._matrices().items():
            self.register_buffer(name, torch.tensor(values, dtype=dtype, device=device), persistent=False)
        duration = torch.tensor(duration, dtype=dtype, device=device)
        self.register_buffer("duration", duration, persistent=bool(learned))
        for name in _LEARNED:
            self.register_buffer(name, learned[name].to(dtype=dtype, device=device) if learned else None)

    def _matrices(self) -> dict[str, Any]:
        """The matrices in double precision; where scale is K, it is part of them."""
        dmp, scale = self.dmp, 1.0 if self.dmp.system.divides_by_amplitude else self.dmp.K
        encode = encoder(dmp, self.n_samples)
        decoders = [decoder(dmp, n) for n in (self.n_samples, max(dmp.n_points, 2 * dmp.n_basis))]
        decode, grid = (
            np.stack((*(scale * r.Phi.transpose(2, 0, 1)), r.goal, r.velocity, _constant(r.goal)), axis=1)
            for r in decoders
        )
        Q, R = np.linalg.qr(decode[0, : dmp.n_basis].T)
        return {
            "decode_matrix": decode,  # (3, N + 3, T)
            "encode_matrix": encode.weights / scale,  # (T, N)
            "velocity_row": encode.velocity,  # (T,)
            "_grid": grid[:2].transpose(2, 0, 1).reshape(grid.shape[2], -1),  # (G, 2 (N + 3))
            "_span": Q,  # (T, r): of all paths that weights can make
            "_within": R,  # (r, N)
            "_centers": dmp.basis.centers,
            "_widths": dmp.basis.widths,
            "_nodes": np.stack((NODES, NODE_WEIGHTS)),
            "_u": np.linspace(0.0, 1.0, self.n_samples),
        }

    def at_rate(self, rate: float, duration: float | None = None) -> Self:
        """Return the same primitive with at least `rate` samples per second, or for another duration [s].

        Weights mean the same: learned at 50 Hz, they move at 1 kHz. Learned durations are replaced by the given one.

        Raises `SpecificationError`: a rate too low to follow the dynamics; a duration of 0 or less.
        """
        check_number("duration", duration, above=0.0, optional=True)
        seconds = self.duration.cpu().numpy() if duration is None else np.array(float(duration))
        learned = {name: value for name in _LEARNED if (value := getattr(self, name)) is not None}
        if duration is not None and learned:
            learned["velocity"] = learned["velocity"] * (self.duration / duration)[:, None]
        n_samples = samples_at_rate(rate, seconds, self.dmp)
        return self._new(self.dmp, self.dims, n_samples, learned, seconds, self._u.dtype, self._u.device)

    def _apply(self, fn: Any, recurse: bool = True) -> Self:
        """Convert buffers; matrices of another precision are computed anew, and those that were without memory."""
        before = self._u.dtype, self._u.is_meta
        super()._apply(fn, recurse)
        if (self._u.dtype, self._u.is_meta) != before:
            for name, values in self._matrices().items():
                setattr(self, name, torch.tensor(values, dtype=self._u.dtype, device=self._u.device))
        return self

    def extra_repr(self) -> str:
        """Say what the module is, in its ``repr``."""
        return f"dims={self.dims}, n_samples={self.n_samples}, {self.dmp}"

    @property
    def times(self) -> Tensor:
        """Times of the samples [s], (T,) or (n, T)."""
        return self._u * self.duration[..., None]

    def forward(
        self,
        weights: Tensor | None = None,
        start: Tensor | None = None,
        goal: Tensor | None = None,
        *,
        velocity: Tensor | None = None,
        duration: Tensor | float | None = None,
        derivative: int | tuple[int, ...] = 0,
    ) -> Any:
        """Generate movements (..., T, d), in one matrix product.

        Parameters
        ----------
        weights : Tensor of shape (..., d, N)
        start, goal : Tensor of shape (..., d)
            x0 and g, in the user's unit.
        velocity : Tensor of shape (..., d), optional
            Initial velocity, per second; by default 0, or the learned one in proportion to the tempo.
        duration : Tensor of shape (...) or float, optional
            Another tau [s]; the T samples are spread over it.
        derivative : {0, 1, 2} or tuple of these, default 0
            Positions, velocities per second, or accelerations per second squared. Of a tuple, such as ``(0, 1)``, a
            tuple of these is returned, which takes less time than one call for each.

        Raises
        ------
        TrajectoryError
            A tensor whose last dimensions are not those above.
        SpecificationError
            Weights, start or goal left out where none are learned; another derivative.
        """
        numbers, tau = self._numbers(weights, start, goal, velocity, duration)
        if isinstance(derivative, tuple):
            return tuple(self._path(numbers, tau, order) for order in derivative)
        return self._path(numbers, tau, derivative)

    def state(
        self,
        at: Tensor | float,
        weights: Tensor | None = None,
        start: Tensor | None = None,
        goal: Tensor | None = None,
        *,
        velocity: Tensor | None = None,
        duration: Tensor | float | None = None,
    ) -> tuple[Tensor, Tensor]:
        """Positions and velocities (..., d) at a time `at` [s] within the duration, which may lie between samples.

        The other parameters, and what is raised, are those of `forward`; `at` is a number or (...).
        """
        numbers, tau = self._numbers(weights, start, goal, velocity, duration)
        states = self._states(numbers, self._number(at) / tau)
        return states[..., 0], states[..., 1] / tau[..., None]

    def replan(  # noqa: PLR0913 - an option per parameter
        self,
        weights: Tensor | None = None,
        *,
        at: Tensor | float,
        position: Tensor,
        velocity: Tensor,
        goal: Tensor | None = None,
        start: Tensor | None = None,
        duration: Tensor | float | None = None,
        derivative: int = 0,
    ) -> Tensor:
        """Generate movements (..., T, d) that go on from a state at a time, with new weights and goal.

        Position and velocity are continuous there. The samples are those of `forward`, so that
        ``torch.where(times[:, None] < at, path, again)`` joins the two; those before `at` are `position`, at rest.
        Errors are those of `forward`.

        Parameters
        ----------
        weights, goal, duration, derivative : as in `forward`
        at : Tensor of shape (...) or float
            Time [s] since the start of the movement, at most the duration; it may lie between samples.
        position, velocity : Tensor of shape (..., d)
            The state at that time, measured or desired; `state` tells the desired one.
        start : Tensor of shape (..., d), optional
            x0 of the whole movement, from which its shape counts: with it, and all else unchanged, the movement goes on
            as planned. By default the learned one, or else `position`.
        """
        position = self._vector("position", position)
        origin = position if start is None and self.start is None else start
        rest = torch.zeros_like(position)
        numbers, tau = self._numbers(weights, origin, goal, rest, duration)
        u = self._number(at) / tau
        speed = self._vector("velocity", velocity) * tau[..., None]
        now = torch.stack(torch.broadcast_tensors(position, speed), dim=-1)
        h = self._u - u[..., None]
        free = self._transition(h.clamp(min=0.0))  # (..., T, 2, 2)
        driven = self._path(numbers, tau, derivative)
        row = -self._K * free[..., 0, :] - self._D * free[..., 1, :] if derivative == 2 else free[..., derivative, :]
        change = row @ (now - self._states(numbers, u)).mT  # (..., T, d)
        before = position if derivative == 0 else rest
        # Times are rounded: a sample at `at` itself must not count as before.
        began = (h > -16 * torch.finfo(h.dtype).eps)[..., None]
        return torch.where(began, driven + change / tau[..., None, None] ** derivative, before[..., None, :])

    def encode(self, positions: Tensor) -> tuple[Tensor, Tensor]:
        """Weights (..., d, N) and goals (..., d) of movements (..., T, d), whose T samples are even in time.

        One matrix product, the fit of `kineme.DMP.learn`. Together with their first sample and `initial_velocity` they
        are what the movements are repeated from.

        Raises `TrajectoryError`: another number of samples or dimensions. Raises `SpecificationError`: a specification
        with preprocessing steps, which work on recordings.
        """
        relative, goal = self._relative(positions)
        weights, distance = relative @ self.encode_matrix, self._distance(relative[..., -1])
        return weights if distance is None else weights / distance[..., None], goal

    def initial_velocity(self, positions: Tensor, *, duration: Tensor | float | None = None) -> Tensor:
        """Velocities (..., d) per second at the start of movements (..., T, d), which are fitted with the weights."""
        relative, _ = self._relative(positions)
        tau = self.duration if duration is None else self._number(duration)
        return relative @ self.velocity_row / tau[..., None]

    def distribution(  # noqa: PLR0913 - an option per parameter
        self,
        mean: Tensor,
        chol: Tensor,
        start: Tensor | None = None,
        goal: Tensor | None = None,
        *,
        velocity: Tensor | None = None,
        duration: Tensor | float | None = None,
        joint: bool = False,
    ) -> tuple[Tensor, Tensor]:
        """Mean (..., T, d) and covariances of the positions, for weights with a Gaussian distribution.

        Errors are those of `forward`.

        Parameters
        ----------
        mean : Tensor of shape (..., d, N)
            Of the weights.
        chol : Tensor of shape (..., d N, d N)
            Factor L of their covariance ``L L'``, of all N weights of one dimension after those of another.
        start, goal, velocity, duration : as in `forward`
        joint : bool, default False
            Covariances of all samples with each other, (..., T, d, T, d), which takes T times the memory of those of
            each sample (..., T, d, d).
        """
        path = self(mean, start, goal, velocity=velocity, duration=duration)
        decode = self.decode_matrix[0, : self.dmp.n_basis].mT
        spread = (decode @ self._factor(chol, start, goal)).movedim(-3, -2)  # (..., T, d, d N)
        if not joint:
            return path, spread @ spread.mT
        flat = spread.flatten(-3, -2)
        shape = (self.n_samples, self.dims)
        return path, (flat @ flat.mT).unflatten(-1, shape).unflatten(-3, shape)

    def log_prob(  # noqa: PLR0913 - an option per parameter
        self,
        positions: Tensor,
        mean: Tensor,
        chol: Tensor,
        start: Tensor | None = None,
        goal: Tensor | None = None,
        *,
        velocity: Tensor | None = None,
        duration: Tensor | float | None = None,
        noise: float = 1e-2,
    ) -> Tensor:
        """Log density (...) of movements (..., T, d) under weights with a Gaussian distribution, and noise.

        It is that of all T d numbers together, with covariance ``A L L' A' + noise^2 I``. Since paths that weights can
        make have but d N dimensions, only a matrix of that size is decomposed, whatever T: outside them is noise alone.
        Errors are those of `encode` and `forward`, and noise that is not above 0.

        Parameters
        ----------
        positions : Tensor of shape (..., T, d)
        mean, chol : as in `distribution`
        start, goal : Tensor of shape (..., d), optional
            By default where the positions begin and end.
        velocity, duration : as in `forward`
        noise : float, default 0.01
            Standard deviation of each number, in the unit of the positions; in single precision not much below a
            thousandth of the extent, where rounding may leave NaN.
        """
        check_number("noise", noise, above=0.0)
        self._relative(positions)  # which checks them
        positions = positions.to(self._u.dtype)
        start = positions[..., 0, :] if start is None else start
        goal = positions[..., -1, :] if goal is None else goal
        residual = (positions - self(mean, start, goal, velocity=velocity, duration=duration)).mT  # (..., d, T)
        inside = residual @ self._span
        outside = (residual - inside @ self._span.mT).square().sum(dim=(-1, -2))
        factor = (self._within @ self._factor(chol, start, goal)).flatten(-3, -2)
        n_inside, n_numbers = factor.shape[-2], self.n_samples * self.dims
        covariance = factor @ factor.mT + noise**2 * torch.eye(n_inside, dtype=factor.dtype, device=factor.device)
        L, failed = torch.linalg.cholesky_ex(covariance)  # which does not wait for a GPU to look at it
        L = L.masked_fill(failed[..., None, None] != 0, math.nan)
        whitened = torch.linalg.solve_triangular(L, inside.flatten(-2)[..., None], upper=False)
        squares = whitened.square().sum(dim=(-1, -2)) + outside / noise**2
        log_volume = L.diagonal(dim1=-2, dim2=-1).log().sum(-1) + (n_numbers - n_inside) * math.log(noise)
        return -0.5 * (squares + n_numbers * math.log(2.0 * math.pi)) - log_volume

    def sample(  # noqa: PLR0913 - an option per parameter
        self,
        size: int,
        mean: Tensor,
        chol: Tensor,
        start: Tensor | None = None,
        goal: Tensor | None = None,
        *,
        velocity: Tensor | None = None,
        duration: Tensor | float | None = None,
        generator: torch.Generator | None = None,
    ) -> Tensor:
        """Draw `size` movements (size, ..., T, d) from that distribution, with gradients in mean and factor.

        Parameters and errors are those of `distribution`; `generator` is the source of the random numbers.
        """
        chol = self._vector("chol", chol, self.dims * self.dmp.n_basis, self.dims * self.dmp.n_basis)
        batch = torch.broadcast_shapes(mean.shape[:-2], chol.shape[:-2])
        shape = (check_count("size", size, 1), *batch, chol.shape[-1], 1)
        normal = torch.randn(shape, generator=generator, dtype=chol.dtype, device=chol.device)
        weights = mean + (chol @ normal)[..., 0].unflatten(-1, (self.dims, self.dmp.n_basis))
        return self(weights, start, goal, velocity=velocity, duration=duration)

    def _factor(self, chol: Tensor, start: Tensor | None, goal: Tensor | None) -> Tensor:
        """Factor (..., d, N, d N) of the weights as they act, times the distance where they count per distance."""
        size = self.dims * self.dmp.n_basis
        factor = self._vector("chol", chol, size, size).unflatten(-2, (self.dims, self.dmp.n_basis))
        if self.counts_per_distance:
            distance = self._distance(self._vector("goal", goal) - self._vector("start", start))
            factor = factor * distance[..., None, None]
        return factor

    def _relative(self, positions: Tensor) -> tuple[Tensor, Tensor]:
        """Positions less their start (..., d, T), and goals."""
        if self.dmp.preprocessing:
            raise SpecificationError(
                f"expected no preprocessing, which works on recordings, got {self.dmp.preprocessing}; apply it before"
            )
        if positions.ndim < 2 or positions.shape[-2:] != (self.n_samples, self.dims):
            raise TrajectoryError(
                f"expected positions (..., {self.n_samples}, {self.dims}), got {tuple(positions.shape)}; "
                "kineme.Resample makes movements of one length"
            )
        x = positions.to(self._u.dtype).mT
        return x - x[..., :1], x[..., -1]

    @property
    def counts_per_distance(self) -> bool:
        """Whether shapes grow with the distance from start to goal, so that nothing moves where it is 0."""
        return self.dmp.formulation in {"original", "amplitude-scaled"}

    def _distance(self, amplitude: Tensor) -> Any:
        """Distance per which weights count, (..., d) or (..., 1) of g - x0 (..., d); None where it does not matter."""
        if self.dmp.formulation == "amplitude-scaled":
            return torch.linalg.vector_norm(amplitude, dim=-1, keepdim=True)
        return amplitude if self.counts_per_distance else None

    def _number(self, value: Tensor | float) -> Tensor:
        how = {"dtype": self._u.dtype, "device": self._u.device}
        # `full` writes a number on the device; `as_tensor` would copy it there, which a CUDA graph cannot capture.
        return torch.full((), value, **how) if isinstance(value, (int, float)) else torch.as_tensor(value, **how)

    def _vector(self, name: str, value: Tensor | None, *shape: int) -> Tensor:
        """A given or learned tensor, in the precision of the module."""
        shape = shape or (self.dims,)
        value = getattr(self, name) if value is None else value
        if value is None:
            raise SpecificationError(f"expected {name}, got none; only Primitive.of has learned ones")
        if tuple(value.shape[-len(shape) :]) != shape:
            expected = ", ".join(map(str, shape))
            raise TrajectoryError(f"expected {name} (..., {expected}), got {tuple(value.shape)}")
        return value.to(self._u.dtype)

    def _numbers(
        self,
        weights: Tensor | None,
        start: Tensor | None,
        goal: Tensor | None,
        velocity: Tensor | None,
        duration: Tensor | float | None,
    ) -> tuple[Tensor, Tensor]:
        """Return numbers ``[w, g - x0, tau v0, x0]`` (..., d, N + 3) and tau (...)."""
        w = self._vector("weights", weights, self.dims, self.dmp.n_basis)
        x0, g = self._vector("start", start), self._vector("goal", goal)
        tau = self.duration if duration is None else self._number(duration)
        if velocity is not None:
            v0 = self._vector("velocity", velocity) * tau[..., None]
        elif self.velocity is not None:
            v0 = self.velocity * self.duration[..., None]  # scales with the tempo
        else:
            v0 = torch.zeros_like(x0)
        amplitude = g - x0
        distance = self._distance(amplitude)
        w = w if distance is None else w * distance[..., None]
        vectors = torch.stack(torch.broadcast_tensors(amplitude, v0, x0, tau[..., None])[:3], dim=-1)
        if w.shape[:-1] != vectors.shape[:-1]:
            batch = torch.broadcast_shapes(w.shape[:-2], vectors.shape[:-2])
            w, vectors = (part.expand(*batch, *part.shape[-2:]) for part in (w, vectors))
        return torch.cat((w, vectors), dim=-1), tau

    def _path(self, numbers: Tensor, tau: Tensor, derivative: int) -> Tensor:
        if derivative not in (0, 1, 2):
            raise SpecificationError(f"expected derivative to be 0, 1 or 2, got {derivative!r}")
        for _ in range(derivative):  # numbers are scaled, since they are fewer than samples
            numbers = numbers / (tau[..., None, None] if tau.ndim else tau)
        return (numbers @ self.decode_matrix[derivative]).mT

    def _states(self, numbers: Tensor, u: Tensor) -> Tensor:
        """States (..., d, 2) in u at shares u (...): those at the even share before, carried on in one step."""
        n_steps = len(self._grid) - 1
        u = u.clamp(0.0, 1.0)
        before = (u.detach() * n_steps).floor().clamp(max=n_steps - 1)
        h = u - before / n_steps
        nodes, node_weights = self._nodes
        elapsed = h[..., None] * nodes  # (..., 8)
        forcing = self._forcing(before[..., None] / n_steps + elapsed) * (h[..., None] * node_weights)[..., None]
        impulse = self._transition(h[..., None] - elapsed)[..., 1]  # (..., 8, 2)
        there = torch.nn.functional.embedding(before.long(), self._grid).unflatten(-1, (2, -1))  # (..., 2, N + 3)
        constant = there[..., -1:]  # of x0, which nothing moves
        carried = self._transition(h) @ there[..., :-1] + torch.nn.functional.pad(impulse.mT @ forcing, (0, 1))
        return numbers @ torch.cat((carried, constant), dim=-1).mT

    def _forcing(self, u: Tensor) -> Tensor:
        """Accelerations in u per unit of w and g - x0 (..., N + 1); see `operators`."""
        s = torch.exp(-self._alpha * u)[..., None]
        basis, system = self.dmp.basis, self.dmp.system
        psi = torch.softmax(-self._widths * (s - self._centers) ** 2, dim=-1)
        gate = s if basis.gating == "phase" else (s / basis.phase.end).clamp(max=1.0)
        scale = 1.0 if system.divides_by_amplitude else self._K
        return torch.cat((scale * psi * gate, self._K + system.coupling(self._K, s)), dim=-1)

    def _transition(self, h: Tensor) -> Tensor:
        """``exp(A h)`` (..., 2, 2) in closed form; see `kineme.dmp.spring_damper.transition`."""
        a = 0.5 * self._D
        square = self._K - a * a
        b = math.sqrt(abs(square))
        if b == 0.0:
            C = torch.exp(-a * h)
            S = C * h
        elif square > 0:
            decay = torch.exp(-a * h)
            C, S = decay * torch.cos(b * h), decay * torch.sin(b * h) / b
        else:
            slow, ratio = torch.exp(-self._K / (a + b) * h), torch.exp(-2.0 * b * h)
            C, S = 0.5 * slow * (1.0 + ratio), -0.5 * slow * torch.expm1(-2.0 * b * h) / b
        return torch.stack((C + a * S, S, -self._K * S, C - a * S), dim=-1).unflatten(-1, (2, 2))


def _constant(goal: Any) -> Any:
    """Response (3, T) to a start elsewhere: all positions are there, and nothing else changes."""
    return np.repeat([[1.0], [0.0], [0.0]], goal.shape[1], axis=1)


def _distances(primitives: Primitives) -> Any:
    """Learned distances |g - x0| (n, 1, 1), refused where a movement is closed."""
    distances = np.linalg.norm(primitives.goals - primitives.starts, axis=1)
    closed = distances <= CLOSED * primitives.extents.max(axis=1)
    if closed.any():
        raise DegenerateMovementError(
            f"{describe(int(closed.argmax()), primitives.names)}: expected a movement that does not end where it "
            'starts, per whose distance the weights of "amplitude-scaled" count, got a closed one; use "bio-inspired"'
        )
    return distances[:, None, None]
