"""Proposals of symbols: clusters of movements for a person to name, of a subsample where they are many."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.anchoring import clustering
from kineme.errors import SpecificationError
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.recognition.classifiers import squares_beside_kernels
from kineme.recognition.conformal import check_groups, comparable_groups
from kineme.reporting.text import counted
from kineme.similarity.describe import Described, describe, squared_distances
from kineme.similarity.similarity import AveragedSimilarity, averaged, compare, similarities
from kineme.similarity.specification import Compares
from kineme.validation import Array, check_choice, check_count

_SHARE = 0.5  # sum of all links by that of the similarities; with 1, classes that few people made are merged
_NEAREST = 5  # movements of a person, of which each counts less than the one before it

_SPECTRAL = "spectral"
#: Of `propose` and of whatever clusters by it.
DEFAULT_METHOD = _SPECTRAL
_LARGEST = 2000  # movements whose similarities are fused at once

_WITHIN = 0.95  # of the sampled members of all clusters are within the common radius of their nearest neighbor
_TILE = 20_000  # movements at a time


@dataclass(frozen=True, eq=False)
class Proposal:
    """A cluster of movements that could be one symbol.

    - `members` (m,): indices of the movements, ascending.
    - `medoid`: index of the member most similar to the others.
    - `cohesion`: mean similarity of two members, from 0 to 1.
    - `stability`: how well the cluster comes again when a fifth of the movements is left out: mean Jaccard coefficient,
      from 0 to 1; 0.75 and more is a valid cluster to Hennig (2007).
    - `nearest`: index of the proposal most similar to this one.
    - `nearness`: mean similarity of its members to these.
    - `name`: a name for it, if something proposes one, such as the tasks of the episodes that it comes from.
    """

    members: NDArray[np.intp]
    medoid: int
    cohesion: float
    stability: float
    nearest: int | None
    nearness: float
    name: str | None = None

    def __len__(self) -> int:
        return len(self.members)

    def __repr__(self) -> str:
        return (
            f"Proposal({len(self)} movements, medoid {self.medoid}, "
            f"cohesion {self.cohesion:.2f}, stability {self.stability:.2f})"
        )


@dataclass(frozen=True, eq=False)
class Proposals:
    """Proposals, the largest first, and what is left over.

    - `clusters` (n,): index of the proposal of each movement, -1 for those left over.
    - `widths` (R,): of the kernels that they were compared with.
    """

    proposals: tuple[Proposal, ...]
    clusters: NDArray[np.intp]
    widths: Array

    @property
    def left_over(self) -> NDArray[np.intp]:
        """Indices of the movements in no proposal, ascending."""
        return np.flatnonzero(self.clusters < 0)

    def __len__(self) -> int:
        return len(self.proposals)

    def __iter__(self) -> Iterator[Proposal]:
        return iter(self.proposals)

    def __getitem__(self, index: int) -> Proposal:
        if not -len(self) <= index < len(self):
            raise IndexError(f"expected the index of one of {len(self)} proposals, got {index}")
        return self.proposals[index]

    def __repr__(self) -> str:
        clusters, n = counted(len(self), "cluster"), len(self.clusters)
        return f"Proposals({clusters} among {n} movements, {len(self.left_over)} left over)"


def describe_clusters(K: Array, clusters: NDArray[np.intp], stabilities: Array, widths: Array) -> Proposals:
    """Proposals, the largest first, of clusters of movements whose similarities K (n, n) are given."""
    c = int(clusters.max(initial=-1)) + 1
    sizes = np.bincount(clusters[clusters >= 0], minlength=c)
    seed = np.array([np.flatnonzero(clusters == k)[0] for k in range(c)], dtype=np.intp)
    order = np.lexsort((seed, -sizes))
    ranked = np.append(np.argsort(order), -1)[clusters]
    H = (ranked[:, None] == np.arange(c)).astype(np.float64)
    sums = K @ H  # of each movement to each cluster
    between = (H.T @ sums) / np.maximum(np.outer(H.sum(0), H.sum(0)), 1.0)
    np.fill_diagonal(between, -1.0)
    proposals = []
    for k in range(c):
        members, m = np.flatnonzero(ranked == k), sizes[order[k]]
        inside = sums[members, k] - 1.0
        near = int(between[k].argmax()) if c > 1 else None
        proposals.append(
            Proposal(
                members,
                int(members[inside.argmax()]),
                float(inside.sum() / max(m * (m - 1), 1)),
                float(stabilities[order[k]]),
                near,
                0.0 if near is None else float(between[k, near]),
            )
        )
    return Proposals(tuple(proposals), ranked, widths)


def check_members(proposal: Proposal, n: int) -> None:
    """Refuse a proposal made of more movements than are given."""
    if len(proposal.members) and proposal.members[-1] >= n:
        raise SpecificationError(
            f"expected the movements that the proposal was made from, at least {proposal.members[-1] + 1}, got {n}"
        )


def largest_clustered(n_dims: int) -> int:
    """Movements that are all compared with each other by default; in space a pair costs a decomposition."""
    return 800 if n_dims == 3 else 5000


def subsample(described: Described, size: int, seed: int = 0) -> tuple[NDArray[np.intp], AveragedSimilarity]:
    """Ascending indices of `size` movements of all clusters, rare ones too; and the similarity at their widths.

    Half are drawn evenly. The others are drawn with probability proportional to ``1 - K`` to the nearest of these, the
    squared distance in the kernel's space up to a factor: one round of k-means|| (Bahmani et al., "Scalable
    k-means++", PVLDB 5, 2012). A cluster too rare for the first half is far from it, so the second half finds it.
    """
    random = np.random.default_rng(seed)
    first = random.choice(len(described), size - size // 2, replace=False)
    far = 1.0 - nearest_neighbors(averaged(described.take(first)), described, described.take(first))[1]
    far[first] = 0.0
    candidates = np.flatnonzero(far > 0)
    second = candidates  # usually more than are wanted
    if len(candidates) > size // 2:
        second = random.choice(candidates, size // 2, replace=False, p=far[candidates] / far.sum())
    sample = np.sort(np.concatenate((first, second))).astype(np.intp)
    return sample, averaged(described.take(sample))


def nearest_neighbors(
    similarity: AveragedSimilarity, described: Described, others: Described
) -> tuple[NDArray[np.intp], Array]:
    """Index of the most similar of the others for each movement, and the similarity, (n,) each."""
    which, how = np.empty(len(described), dtype=np.intp), np.empty(len(described))
    for start in range(0, len(described), _TILE):
        rows = slice(start, start + _TILE)
        K = compare(similarity, described.take(rows), others)
        which[rows] = K.argmax(axis=1)
        how[rows] = K.max(axis=1)
    return which, how


def extend(
    described: Described, sample: NDArray[np.intp], K: Array, of_sample: Proposals, similarity: AveragedSimilarity
) -> Proposals:
    """The proposals of a sample, with the movements within the radius of their nearest neighbor's cluster added."""
    radius = np.append(radii(K, of_sample), -np.inf)  # nothing is added to what was left over
    which, how = nearest_neighbors(similarity, described, described.take(sample))
    clusters = of_sample.clusters[which]
    clusters[1.0 - how > radius[clusters]] = -1
    clusters[sample] = of_sample.clusters
    order = np.argsort(-np.bincount(clusters[clusters >= 0], minlength=len(of_sample)), kind="stable")
    rank = np.append(np.argsort(order), -1)
    clusters = rank[clusters]
    proposals = tuple(
        replace(
            of_sample[int(k)],
            members=np.flatnonzero(clusters == i),
            medoid=int(sample[of_sample[int(k)].medoid]),
            nearest=None if of_sample[int(k)].nearest is None else int(rank[of_sample[int(k)].nearest]),
        )
        for i, k in enumerate(order)
    )
    return Proposals(proposals, clusters, of_sample.widths)


def radii(K: Array, proposals: Proposals) -> Array:
    """Return how far ``1 - K`` a movement of each cluster may be from its nearest member, shape (c,).

    As far as any member is from its nearest neighbor in the cluster, so that another movement of the same class is
    beyond it once in m + 1 times; but at least as far as 95 % of the members of all clusters, since the largest of few
    distances says little.
    """
    same = (proposals.clusters[:, None] == proposals.clusters) & (proposals.clusters[:, None] >= 0)
    np.fill_diagonal(same, False)
    away = 1.0 - np.where(same, K, -np.inf).max(axis=1)
    member = proposals.clusters >= 0
    if not member.any():
        return np.empty(0)
    common = float(np.quantile(away[member], _WITHIN))
    return np.array([max(common, float(away[proposal.members].max())) for proposal in proposals.proposals])


def propose(  # noqa: PLR0913 - what is asked, and how it is compared
    movements: MovementsLike | Described,
    method: str = DEFAULT_METHOD,
    n_clusters: int | None = None,
    *,
    groups: ArrayLike | None = None,
    min_members: int = 3,
    like: Compares | None = None,
    max_clustered: int | None = None,
) -> Proposals:
    """Cluster movements without labels.

    By default (``method="spectral"``) movements are similar whose neighbors are similar, in several representations
    together and at the scale of each neighborhood, see `kineme.anchoring.clustering.fuse`; of signals, and of more than
    three columns that are no points, in profiles and recorded values, too. So movements of several people connect, of
    whom each repeats the own way more closely than that of others. Name who made each by `groups` where that is known.
    The other methods take distances ``1 - K`` of the averaged kernel: what is far is just far.

    Parameters
    ----------
    movements : Described, or movements as `Demonstrations.of` accepts them
        At least three.
    method : {"spectral", "agglomerative", "hdbscan"}, default "spectral"
        Spectral clustering, in `n_clusters`; average linkage, cut into `n_clusters`; or clusters of density (HDBSCAN),
        which find their number themselves.
    n_clusters : int, optional
        Number of proposals, fewer where the movements do not fall into so many of `min_members` each; with
        "agglomerative" the number of clusters of the tree, those too small to be proposed included. By default it is
        found, by gaps between eigenvalues or by `count_clusters`, and is at least two: whether all movements are one
        cluster cannot be told from their own distances. Of two numbers that may be, "spectral" takes the larger: two
        proposals of one kind are merged by giving both one name.
    groups : array_like of shape (n,), optional
        Who made each movement; the other methods ignore it. Movements of two people are linked if they are among each
        other's nearest: classes that each draws in an own way are found together, and classes that are alike apart. See
        `kineme.anchoring.proposals.link_people`.
    min_members : int, default 3
        Movements of a proposal, at least; smaller clusters are left over.
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose representations, invariances and mean to take; it need not be fitted.
    max_clustered : int, optional
        More movements than this are clustered by a subsample of so many; each of the others is added to the cluster of
        its nearest neighbor in the subsample, by the averaged kernel, if it is within the radius of that cluster, else
        it is left over. By default 2000; with the other methods 5000, in space 800.

    Raises
    ------
    SpecificationError
        Parameters out of range, fewer than three movements, or copies of one movement.
    TrajectoryError
        Not one group for each movement.
    """
    check_choice("method", method, [_SPECTRAL, *clustering.METHODS])
    check_count("min_members", min_members, 2)
    described = describe(movements, like)
    if n_clusters is not None:
        check_count("n_clusters", n_clusters, 1)
        if method == "hdbscan":
            raise SpecificationError(
                f"expected no n_clusters with method={method!r}, got {n_clusters!r}; it finds its own"
            )
        if n_clusters > len(described):
            raise SpecificationError(
                f"expected n_clusters of at most {len(described)}, the number of movements, got {n_clusters!r}"
            )
    people = None if groups is None else comparable_groups(check_groups(groups, len(described)))
    by_default = _LARGEST if method == _SPECTRAL else largest_clustered(described.n_dims)
    limit = by_default if max_clustered is None else max_clustered
    check_count("max_clustered", limit, 3)
    if len(described) <= limit:
        return _propose(described, averaged(described), method, n_clusters, min_members, people)[1]
    sample, similarity = subsample(described, limit)
    people = None if people is None else people[sample]
    K, clusters = _propose(described.take(sample), similarity, method, n_clusters, min_members, people)
    return extend(described, sample, K, clusters, similarity)


def _propose(
    described: Described,
    similarity: AveragedSimilarity,
    method: str,
    n_clusters: int | None,
    min_members: int,
    people: NDArray[np.intp] | None,
) -> tuple[Array, Proposals]:
    """Similarities K (n, n) at the widths given, and proposals."""
    K = similarities(described, widths=similarity.widths)
    order = own_order(K)
    clusters = np.empty(len(K), dtype=np.intp)
    if method == _SPECTRAL:
        ordered = None if people is None else people[order]
        in_order, stable = _by_neighbors(described.take(order), n_clusters, min_members, ordered)
    else:
        in_order, stable = _by_distances(1.0 - K[np.ix_(order, order)], method, n_clusters, min_members)
    clusters[order] = in_order
    return K, describe_clusters(K, clusters, stable, similarity.widths)


def _by_neighbors(
    described: Described, n_clusters: int | None, min_members: int, people: NDArray[np.intp] | None
) -> tuple[clustering.Clusters, Array]:
    """Clusters of movements that are not alone, and how stable each is."""
    shape = by_shape(described)
    squares = squared_distances(shape, shape)
    squares = 0.5 * (squares + squares.transpose(0, 2, 1))
    component = clustering.components(squares)
    large = np.flatnonzero(np.bincount(component)[component] >= min_members)
    clusters = np.full(len(described), -1, dtype=np.intp)
    if len(large) < 3:
        return clusters, np.empty(0)
    shares, others = squares_beside_kernels(described.take(large))
    own = np.ones(len(squares)) if shape.own_weights is None else np.array(shape.own_weights)
    weights = np.append((1.0 - shares.sum()) * own / own.sum(), shares)
    squares = np.concatenate((squares[:, large[:, None], large], others))
    similar = clustering.fuse(squares, weights)
    who = None if people is None else people[large]
    if who is not None:
        similar = link_people(similar, clustering.local_similarities(squares, weights), who)
    similar = clustering.set_apart(similar, component[large])
    wanted = clustering.count_by_eigengap(similar, min_members, who) if n_clusters is None else n_clusters
    clusters[large] = clustering.spectral(similar, wanted, min_members)
    stable = clustering.stabilities(similar, clusters[large], lambda some: clustering.spectral(some, wanted))
    return clusters, stable


def by_shape(described: Described) -> Described:
    """Without the forcing term, if movements are also compared pair by pair: across people it tells little."""
    if described.pairs is None:
        return described
    n, own, coarse = len(described.blocks), described.own_weights, described.coarse()
    chosen = [r for r, block in enumerate(described.blocks) if block is described.pairs.positions]
    chosen += [r for r in range(n, described.n_representations) if own is None or own[r] > 0]
    selected = described.select(chosen)
    return selected if own is None else replace(selected, own_weights=tuple(own[coarse[r]] for r in chosen))


def _by_distances(
    distances: Array, method: str, n_clusters: int | None, min_members: int
) -> tuple[clustering.Clusters, Array]:
    """Clusters of all movements, and how stable each is."""
    count = n_clusters or 0
    if method == "agglomerative" and n_clusters is None:
        count = clustering.count_clusters(distances)

    def again(some: Array) -> clustering.Clusters:
        return clustering.METHODS[method](some, count, 1 if method == "agglomerative" else min_members)

    clusters = clustering.METHODS[method](distances, count, min_members)
    return clusters, clustering.stabilities(distances, clusters, again)


def own_order(K: Array) -> NDArray[np.intp]:
    """An order of the movements by their similarities, so that the result does not depend on that of the input."""
    return np.argsort(K.sum(axis=1), kind="stable")


def link_people(similar: Array, near: Array, people: NDArray[np.intp]) -> Array:
    """Similarities W (n, n) with links added between people, half as strong in total.

    Among the movements of j's person, j is the p-th nearest to i, and among those of i's person i the q-th nearest to
    j. If both are among the five nearest and the people differ, the link of i and j is ``1 / (p q)``, up to a factor:
    one link suffices where each class was made once, and several connect repetitions. If one of the two people never
    made the class of i, its nearest movement by that person is, as a rule, nearer to others, and there is no link.

    Source: L. Haghverdi et al., "Batch effects in single-cell RNA-sequencing data are corrected by matching mutual
    nearest neighbors", Nature Biotechnology 36, 2018. A person's repetitions are each other's nearest neighbors; among
    the nearest of all movements there may be none by another person, so neighbors are taken from each person in turn,
    where `near` (n, n) is greatest.
    """
    n = len(similar)
    share = np.zeros((n, n))  # 1 / p
    for person in np.unique(people):
        own = np.flatnonzero(people == person)
        nearest = own[np.argsort(-near[:, own], axis=1, kind="stable")[:, :_NEAREST]]
        share[np.arange(n)[:, None], nearest] = 1.0 / np.arange(1, nearest.shape[1] + 1)
    links = np.where(people[:, None] != people, share * share.T, 0.0)
    total = float(links.sum())
    return np.asarray(similar + (_SHARE * float(similar.sum()) / total if total > 0 else 0.0) * links)
