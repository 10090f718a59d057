"""Policy improvement of a primitive by trying variants that are smooth in acceleration, in batches.

The weights of one dimension change with the covariance ``(L'L)^-1``, L being second differences with zeros beyond both
ends, as in E. Theodorou, J. Buchli and S. Schaal, "A Generalized Path Integral Control Approach to Reinforcement
Learning", JMLR 11, 2010, and M. Kalakrishnan et al., "STOMP", ICRA 2011, for differences of the path. It is conditioned
on no change of position and velocity at the end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.discrete.operators import condition, decoder
from kineme.dmp.discrete.rollout import Rollout
from kineme.dmp.discrete.specification import Specification
from kineme.dmp.styles.parameters import check_primitives
from kineme.errors import SpecificationError
from kineme.validation import Array, as_numbers, check_choice, check_count, check_number, check_seed, check_switch

_SHARPNESS = 10.0  # h of PI^BB: exp(-h) is the weight of the worst variant beside the best
_DECAY = 0.95  # of the exploration of PI^BB, in each update


@dataclass(frozen=True, eq=False)
class Search:
    """Distribution of the next variants z (p,), ``center + size * N(0, covariance)``; that of the first is N(0, I)."""

    center: Array  # (p,)
    size: float
    covariance: Array  # (p, p)
    path: Array  # (p,), evolution path of the covariance
    size_path: Array  # (p,), evolution path of the size
    update: int = 0

    @classmethod
    def start(cls, n_numbers: int) -> Search:
        """Around 0 with the covariance I."""
        return cls(np.zeros(n_numbers), 1.0, np.eye(n_numbers), np.zeros(n_numbers), np.zeros(n_numbers))

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """Variants (n, p), the first of which is the center."""
        root = np.linalg.cholesky(self.covariance)
        drawn = self.center + self.size * rng.standard_normal((n, len(self.center))) @ root.T
        drawn[0] = self.center
        return drawn


def path_integral(search: Search, variants: Array, costs: Array) -> Search:
    """PI^BB: the mean of the variants, weighted by ``exp(-h (J - min J) / (max J - min J))``, h = 10.

    F. Stulp and O. Sigaud, "Policy Improvement Methods: Between Black-Box Optimization and Episodic Reinforcement
    Learning", 2012. The exploration shrinks by 5 % an update and keeps its shape.
    """
    relative = (costs - costs.min()) / max(np.ptp(costs), np.finfo(float).tiny)
    weights = np.exp(-_SHARPNESS * relative)
    center = weights / weights.sum() @ variants
    return replace(search, center=center, size=search.size * _DECAY, update=search.update + 1)


def covariance_adaptation(search: Search, variants: Array, costs: Array) -> Search:
    """CMA-ES: the better half, ranked; covariance and size follow the steps that were taken.

    N. Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv:1604.00772, 2016, Table 1 with positive weights: Eq. (42)
    center, (43)-(44) size, (45)-(47) covariance. The center is one of the variants and no draw: it is left out here.
    """
    p, drawn, paid = len(search.center), variants[1:], costs[1:]
    half = len(drawn) // 2
    weights = np.log(half + 0.5) - np.log(np.arange(1, half + 1))
    weights /= weights.sum()
    effective = 1.0 / np.sum(weights**2)
    c_size = (effective + 2.0) / (p + effective + 5.0)
    damping = 1.0 + 2.0 * max(0.0, np.sqrt((effective - 1.0) / (p + 1.0)) - 1.0) + c_size
    c_path = (4.0 + effective / p) / (p + 4.0 + 2.0 * effective / p)
    c_one = 2.0 / ((p + 1.3) ** 2 + effective)
    c_rank = min(1.0 - c_one, 2.0 * (effective - 2.0 + 1.0 / effective) / ((p + 2.0) ** 2 + effective))
    expected = np.sqrt(p) * (1.0 - 1.0 / (4.0 * p) + 1.0 / (21.0 * p**2))

    steps = (drawn[np.argsort(paid, kind="stable")[:half]] - search.center) / search.size
    step = weights @ steps
    values, vectors = np.linalg.eigh(search.covariance)
    whitened = vectors @ (vectors.T @ step / np.sqrt(values))
    size_path = (1.0 - c_size) * search.size_path + np.sqrt(c_size * (2.0 - c_size) * effective) * whitened
    length = np.linalg.norm(size_path)
    settled = np.sqrt(1.0 - (1.0 - c_size) ** (2 * (search.update + 1)))
    moving = float(length / settled < (1.4 + 2.0 / (p + 1.0)) * expected)
    path = (1.0 - c_path) * search.path + moving * np.sqrt(c_path * (2.0 - c_path) * effective) * step
    remaining = 1.0 - c_rank - c_one * (1.0 - (1.0 - moving) * c_path * (2.0 - c_path))
    covariance = remaining * search.covariance + c_one * np.outer(path, path) + c_rank * (steps.T * weights) @ steps
    size = search.size * np.exp(min(1.0, c_size / damping * (length / expected - 1.0)))
    return Search(search.center + search.size * step, float(size), covariance, path, size_path, search.update + 1)


METHODS: dict[str, Callable[[Search, Array, Array], Search]] = {"cma-es": covariance_adaptation, "pi-bb": path_integral}

_NEGLIGIBLE = 1e-2  # of the largest: directions that change the path less are not explored

_FEWEST_BASIS = 4
_MOST = 100_000  # rollouts, and updates
_WIDEST = 1e3  # extents


@dataclass(frozen=True, eq=False)
class Improvement:
    """Result of `improve`.

    - `primitive`: the variant with the least cost of all that were tried, a batch of one.
    - `costs` (u, n): cost of each variant in each update; the first of a row is the center, the very first the
      primitive as it was.
    - `exploration` (u,): standard deviation of the paths in each update, where it is largest, as a share of the
      movement's extent.
    - `stopped`: why there were no more updates.
    """

    primitive: Primitives
    costs: Array
    exploration: Array
    stopped: str

    @property
    def cost(self) -> float:
        """The cost of `primitive`."""
        return float(self.costs.min())

    @property
    def best(self) -> Array:
        """The least cost so far, after each update, shape (u,)."""
        return np.asarray(np.minimum.accumulate(self.costs.min(axis=1)))


def improve(  # noqa: PLR0913 - one parameter per option
    primitive: Primitives,
    cost: Callable[[Rollout], ArrayLike],
    rollouts: int = 20,
    *,
    updates: int = 50,
    method: str = "cma-es",
    exploration: float = 0.1,
    seed: int | np.random.Generator = 0,
    target: float | None = None,
    smallest: float = 1e-4,
    start: ArrayLike | None = None,
    goal: ArrayLike | None = None,
    duration: float | None = None,
    n_samples: int | None = None,
    progress: bool = False,
) -> Improvement:
    """Find a variant of a primitive that costs less, by trying `rollouts` variants at a time.

    The weights change, with the covariance ``(L'L)^-1`` at first, L being second differences: variants are smooth in
    acceleration. Start, goal, duration and the way in which the goal is reached, its velocity, stay.

    Parameters
    ----------
    primitive : Primitives
        A batch of one.
    cost : callable
        Gets a `Rollout` of `rollouts` movements and returns their costs, shape (rollouts,); less is better. The first
        movement is the center of the search. A movement that fails needs a large cost, not NaN.
    rollouts : int, default 20
        Variants in one update, at least 5.
    updates : int, default 50
        The most updates.
    method : {"cma-es", "pi-bb"}, default "cma-es"
        Rank the variants and adapt the covariance of the exploration to what helped (Hansen 2016), or average them,
        weighted by their costs (PI^BB, Stulp and Sigaud 2012).
    exploration : float, default 0.1
        Standard deviation of the first paths where it is largest, as a share of the movement's largest extent.
    seed : int or numpy.random.Generator, default 0
        Equal seeds give equal results.
    target : float, optional
        Stop at a cost of this or less.
    smallest : float, default 1e-4
        Stop when the exploration is less than this share of the extent.
    start, goal, duration, n_samples : optional
        Of the movements that are tried, as in `Primitives.rollout`, and of the resulting primitive.
    progress : bool, default False
        Show a progress bar.

    Raises
    ------
    SpecificationError
        Costs of another number, NaN or infinite; not one primitive; a parameter out of its range.
    TrajectoryError
        No primitive, or a start or goal of another shape.

    Examples
    --------
    >>> import kineme, numpy as np
    >>> primitive = kineme.DMP().learn(kineme.load_lasa(["CShape"]))[0]
    >>> better = kineme.improve(primitive, lambda rollout: np.abs(rollout.accelerations).max(axis=(1, 2)), updates=5)
    >>> bool(better.cost < better.costs[0, 0])
    True
    """
    from tqdm import tqdm  # only who searches needs it

    check_primitives(primitive)
    if len(primitive) != 1:
        raise SpecificationError(f"expected one primitive to improve, got {len(primitive)}; choose one, primitives[:1]")
    if primitive.dmp.n_basis < _FEWEST_BASIS:
        raise SpecificationError(
            f"expected at least {_FEWEST_BASIS} basis functions, so that the shape can change and the end stay, got "
            f"{primitive.dmp.n_basis}"
        )
    check_count("rollouts", rollouts, 5, most=_MOST)
    check_count("updates", updates, 1, most=_MOST)
    check_choice("method", method, list(METHODS))
    check_number("exploration", exploration, above=0.0, most=_WIDEST)
    check_number("smallest", smallest, least=0.0)
    check_number("target", target, optional=True)
    check_switch("progress", progress)
    if not callable(cost):
        raise SpecificationError(f"expected cost to be a function of a Rollout, got {cost!r}")
    if not isinstance(seed, np.random.Generator):
        check_seed("seed", seed)
    primitive = Primitives.from_rollout(primitive.rollout(start, goal, duration))
    unit = exploration_factor(primitive.dmp)
    factor = unit * primitive.extents.max() * exploration
    responses = unit @ decoder(primitive.dmp, primitive.dmp.n_points).Phi[0].T
    rng = np.random.default_rng(seed)
    search = Search.start(primitive.n_dims * len(factor))
    tried: list[Array] = []
    sizes: list[float] = []
    best, stopped = (np.inf, search.center), f"{updates} updates"
    with tqdm(total=updates, desc="improving", leave=False, disable=not progress) as bar:
        for update in range(updates):
            drawn = search.draw(rollouts, rng)
            moved = variants(primitive, factor, drawn).rollout(n_samples=n_samples)
            costs = checked_costs(cost(moved), rollouts, update)
            tried.append(costs)
            sizes.append(exploration * largest_deviation(search, responses))
            best = min(best, (float(costs.min()), drawn[costs.argmin()]), key=lambda pair: pair[0])
            bar.update()
            if target is not None and best[0] <= target:
                stopped = f"a cost of {best[0]:.6g}, at most the target {target:.6g}"
                break
            if sizes[-1] < smallest:
                stopped = f"an exploration of {sizes[-1]:.3g} of the extent, less than {smallest:.3g}"
                break
            search = METHODS[method](search, drawn, costs)
    return Improvement(variants(primitive, factor, best[1][None]), np.array(tried), np.array(sizes), stopped)


def checked_costs(costs: ArrayLike, n: int, update: int) -> Array:
    """The costs (n,) of the movements of an update, as a copy."""
    paid = as_numbers(costs, "cost", f"{n} numbers, the cost of each movement")
    if paid.shape != (n,):
        raise SpecificationError(
            f"expected the cost to return {n} numbers, one for each movement of the rollout, got shape {paid.shape}; "
            "reduce over samples and dimensions, axis=(1, 2)"
        )
    if not np.isfinite(paid).all():
        i = int(np.argmin(np.isfinite(paid)))
        raise SpecificationError(
            f"expected finite costs, got {paid[i]:g} for movement {i} of update {update}; "
            "give a movement that fails a large cost"
        )
    return paid.copy()


def exploration_factor(dmp: Specification) -> Array:
    """F (r, N), ``F.T @ F`` being the covariance of one dimension's change of W; the paths deviate by 1 at the most."""
    n_basis = dmp.n_basis
    L = np.diff(np.eye(n_basis + 4, n_basis, -2), n=2, axis=0)
    smooth = np.linalg.inv(np.linalg.qr(L, mode="r")).T  # F0' F0 = (L'L)^-1
    response = decoder(dmp, dmp.n_points)
    held = condition(smooth, response.Phi[:2, -1]).factor
    U, S, paths = np.linalg.svd(held @ response.Phi[0].T, full_matrices=False)
    chosen = _NEGLIGIBLE * S[0] < S
    largest = np.linalg.norm(S[chosen, None] * paths[chosen], axis=0).max()
    return np.asarray(U[:, chosen].T @ held / largest)


def variants(primitive: Primitives, factor: Array, z: Array) -> Primitives:
    """One primitive n times, its weights changed by z (n, d r) times the factor (r, N) of one dimension."""
    n, d = len(z), primitive.n_dims
    changes = (z.reshape(n * d, -1) @ factor).reshape(n, d, -1)
    repeated = primitive[np.zeros(n, dtype=int)]
    return replace(repeated, scaled_weights=repeated.scaled_weights + changes)


def largest_deviation(search: Search, responses: Array) -> float:
    """Largest standard deviation of the paths, 1 at the start; `responses` (r, T) are the paths of r numbers."""
    r = len(responses)
    blocks = search.covariance.reshape(-1, r, search.covariance.shape[0] // r, r)
    variances = [np.einsum("ru,rs,su->u", responses, blocks[k, :, k], responses).max() for k in range(len(blocks))]
    return float(search.size * np.sqrt(max(variances)))
