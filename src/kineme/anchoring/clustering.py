"""Clusters of movements from their similarities, how many there are, and which come again in subsets.

Sources: A. Ng, M. Jordan, Y. Weiss, "On spectral clustering: analysis and an algorithm", NIPS 14, 2001; U. von Luxburg,
"A tutorial on spectral clustering", Statistics and Computing 17, 2007 (section 8.3: the eigengap); B. Wang et al.,
"Similarity network fusion for aggregating data types on a genomic scale", Nature Methods 11, 2014; A. Ben-Hur, A.
Elisseeff, I. Guyon, "A stability based method for discovering structure in clustered data", Pacific Symposium on
Biocomputing 7, 2002 (agreement of clusterings of subsets, as a function of their number); C. Hennig, "Cluster-wise
assessment of cluster stability", Computational Statistics & Data Analysis 52, 2007 (the Jaccard coefficient of one
cluster with the most similar one in each subset).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.linalg import eigh
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import squareform

from kineme.validation import Array

Clusters = NDArray[np.intp]

#: Neighbors in the graph of each representation; the fused similarities of both are added up.
NEIGHBORS = (7, 15)
_WIDTH = 0.4  # mu of the source, Eq. (2), which recommends 0.3 to 0.8; wider ones merge classes of a few movements
_ROUNDS = 5  # of fusion; it has converged
_FAR = 5.0  # times the usual distance to a neighbor
_APART = 1e-3  # of their similarity is left to movements of components apart
_NONE = 1e-6  # largest distance, as a share of the typical one, of movements that do not differ
_LEAST = 1e-30  # similarity, above 0
_FEW = 0.2  # of the clusters may be small
_LEAST_GAP = 0.15  # of the largest gap between eigenvalues: numbers of clusters that may be


def fuse(squares: Array, weights: ArrayLike | None = None) -> Array:
    """Similarities W (n, n) of movements: symmetric, at least 0, and 0 on the diagonal.

    In representation r, ``A_r(i, j) = exp(-d_r^2 / (mu e_ij^2))`` with e_ij the mean of d_r(i, j) and of the typical
    distances of i and of j to their neighbors: a dense class and a loose one are treated alike. Of each A_r a full
    P_r and a sparse S_r, of the nearest neighbors alone, have rows that sum to 1. Five times, every
    ``P_r <- S_r (mean of the other P) S_r^T``: pairs are similar whose neighbors are similar in the other
    representations. W is the mean of the P_r, added up over 7 and 15 neighbors: few for classes of a few movements, and
    many so that the movements of several people connect. Means are weighted.

    `squares` (R, n, n) are of at least three movements; representations in which no two differ are left out. `weights`
    (R,) are above 0, and equal by default.
    """
    differ, weights = _differing(squares, weights)
    return np.asarray(sum(_fused(differ, weights, neighbors) for neighbors in NEIGHBORS))


def local_similarities(squares: Array, weights: ArrayLike | None = None) -> Array:
    """The mean of the A_r of `fuse` with 7 neighbors, (n, n): at the local scale, and not yet fused."""
    differ, weights = _differing(squares, weights)
    k = min(*NEIGHBORS, squares.shape[1] - 1)
    return np.asarray(
        sum(w * _similar(distances, k) for w, distances in zip(weights, differ, strict=True)) / weights.sum()
    )


def components(squares: Array) -> NDArray[np.intp]:
    """Index of the component of each movement, (n,): far from all other components, in chains of neighbors.

    s_r(i) is the distance of movement i to its second nearest neighbor in representation r, and u_r(i) the smallest
    s_r of these neighbors, but at least the median of all. Two movements i and j are linked if d_r(i, j) is less than
    five times the larger of u_r(i) and u_r(j), in the geometric mean over representations; components are what
    links connect. Movements of one class have 3.2 to their second neighbors at most, among people's and drawn ones;
    movements of no class have 8 and more.
    """
    logs = []
    for square in squares:
        distances = np.sqrt(np.maximum(square, 0.0))
        np.fill_diagonal(distances, -1.0)
        nearest = np.argpartition(distances, 2, axis=1)[:, :3]
        own = np.take_along_axis(distances, nearest, axis=1).max(axis=1)
        if (typical := float(np.median(own))) > 0:
            usual = np.maximum(own[nearest].min(axis=1), typical)
            logs.append(np.log(np.maximum(distances, _NONE * typical) / np.maximum(usual[:, None], usual)))
    if not logs:
        return np.zeros(squares.shape[1], dtype=np.intp)
    return np.asarray(connected_components(np.mean(logs, axis=0) < np.log(_FAR))[1], dtype=np.intp)


def set_apart(similar: Array, component: NDArray[np.intp]) -> Array:
    """Similarities in which components smaller than a neighborhood, which fusion connects, are nearly alone."""
    few = np.bincount(component)[component] <= min(NEIGHBORS)
    apart = (component[:, None] != component) & (few[:, None] | few)
    return np.where(apart, _APART * similar, similar)


def _differing(squares: Array, weights: ArrayLike | None) -> tuple[list[Array], Array]:
    """Representations in which movements differ, one at least, and their weights."""
    given = np.ones(len(squares)) if weights is None else np.asarray(weights, dtype=np.float64)
    varying = [r for r, square in enumerate(squares) if square.max() > 0] or [0]
    return [squares[r] for r in varying], given[varying]


def _fused(squares: list[Array], weights: Array, neighbors: int) -> Array:
    """The mean of the P_r after all rounds."""
    n = len(squares[0])
    k = max(2, min(neighbors, n // 2 - 1))
    graphs = [_graphs(square, min(k, n - 1)) for square in squares]
    full, sparse = [graph[0] for graph in graphs], [graph[1] for graph in graphs]
    if len(full) == 1:
        full = [_diffused(sparse[0], full[0])]
    else:
        for _ in range(_ROUNDS):
            total = sum(w * P for w, P in zip(weights, full, strict=True))
            others = [(total - w * P) / (weights.sum() - w) for w, P in zip(weights, full, strict=True)]
            full = [_diffused(S, P) for S, P in zip(sparse, others, strict=True)]
    fused = np.asarray(sum(w * P for w, P in zip(weights, full, strict=True)) / weights.sum())
    np.fill_diagonal(fused, 0.0)
    return fused


def _graphs(squares: Array, k: int) -> tuple[Array, csr_array]:
    """P_r (n, n) with half of each row on the diagonal, and S_r (n, n) with k neighbors and the movement itself."""
    n, similar = len(squares), _similar(squares, k)
    np.fill_diagonal(similar, 2.0)  # itself first
    nearest = np.argpartition(-similar, k, axis=1)[:, : k + 1]
    np.fill_diagonal(similar, 1.0)
    values = np.take_along_axis(similar, nearest, axis=1)
    values /= values.sum(axis=1, keepdims=True)
    starts = np.arange(0, n * (k + 1) + 1, k + 1)
    sparse = csr_array((values.ravel(), nearest.ravel(), starts), shape=(n, n))
    np.fill_diagonal(similar, 0.0)
    full = 0.5 * similar / similar.sum(axis=1, keepdims=True)
    np.fill_diagonal(full, 0.5)
    return full, sparse


def _similar(squares: Array, k: int) -> Array:
    """A_r (n, n), at the scale of k neighbors."""
    distances = np.sqrt(np.maximum(squares, 0.0))
    np.fill_diagonal(distances, 0.0)
    typical = np.partition(distances, k, axis=1)[:, : k + 1].sum(axis=1) / k
    scale = (typical[:, None] + typical + distances) / 3.0
    scale = np.maximum(scale, _NONE * float(np.median(distances)) + np.finfo(float).tiny)
    return np.asarray(np.maximum(np.exp(-((distances / scale) ** 2) / _WIDTH), _LEAST))


def _diffused(sparse: csr_array, full: Array) -> Array:
    """``S P S^T`` with 1 added on the diagonal, its rows summing to about 1, symmetric."""
    moved = sparse @ (sparse @ full).T
    moved = 0.5 * (moved + moved.T)
    np.einsum("ii->i", moved)[:] += 1.0
    moved /= moved.sum(axis=1, keepdims=True)
    return np.asarray(0.5 * (moved + moved.T))


def count_by_eigengap(similar: Array, min_members: int = 1, people: NDArray[np.intp] | None = None) -> int:
    """The number of clusters c, from 2 to n / 2, by gaps between the c-th and the next eigenvalue.

    Of the normalized similarities ``D^-1/2 W D^-1/2``, with W as `fuse` gives it. With c clusters that nothing
    connects, c eigenvalues are 1. Candidates are all c whose gap is at least 0.15 of the largest. The result is the
    larger of the c with the largest gap, which is often that between a few groups of similar clusters, and the
    candidate with the best mean silhouette in ``-log W``, see `mean_silhouettes`: two clusters of one kind are merged
    at a glance, and kinds that were never divided are not seen. No candidates are clusterings with more than a fifth of
    clusters of fewer than `min_members`, or, where `people` (n,) made the movements, with more than half of the
    movements in clusters of one person: these are people and no kinds.
    """
    n = len(similar)
    values, vectors = (array[..., ::-1] for array in eigh(_normalized(similar)))
    most = min(max(2, n // 2), n - 1)
    gaps = values[1:most] - values[2 : most + 1]
    distances = -np.log(np.maximum(similar, _LEAST))
    distances = 0.5 * (distances + distances.T) - distances[~np.eye(n, dtype=bool)].min()
    np.fill_diagonal(distances, 0.0)
    counts = [int(gaps.argmax()) + 2]
    scores = [-np.inf]
    for c in (np.flatnonzero(gaps >= _LEAST_GAP * gaps.max()) + 2).tolist():
        clusters = _by_directions(vectors[:, :c], c)
        sizes = np.bincount(clusters)
        if 1 < len(sizes) < n and (sizes < min_members).mean() <= _FEW and _shared(clusters, people):
            counts.append(c)
            scores.append(_mean_silhouette(_sums_by(distances, clusters), clusters))
    return max(counts[0], counts[int(np.argmax(scores))])


def _shared(clusters: Clusters, people: NDArray[np.intp] | None) -> bool:
    """Tell whether half of the movements or more are in clusters of several people, if there are several."""
    if people is None or len(np.unique(people)) == 1:
        return True
    several = np.array([len(np.unique(people[clusters == k])) > 1 for k in range(int(clusters.max()) + 1)])
    return bool(several[clusters].mean() >= 0.5)


def spectral(similar: Array, n_clusters: int, min_members: int = 1) -> Clusters:
    """Return `n_clusters` clusters of at least `min_members`, fewer if movements do not fall into so many; -1 is none.

    By average linkage of the cosines of entries in as many eigenvectors. Clusters of too few members are left over, and
    of the others the loosest is divided until there are enough.
    """
    wanted = max(1, min(n_clusters, len(similar) // min_members))
    n = len(similar)
    return _by_directions(eigh(_normalized(similar), subset_by_index=(n - wanted, n - 1))[1], wanted, min_members)


def _by_directions(vectors: Array, wanted: int, min_members: int = 1) -> Clusters:
    """Return clusters of movements by the directions of their entries in eigenvectors (n, wanted)."""
    rows = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), np.finfo(float).tiny)
    distances = np.maximum(1.0 - rows @ rows.T, 0.0)
    distances = 0.5 * (distances + distances.T)
    np.fill_diagonal(distances, 0.0)
    tree = average_linkage(distances)
    clusters = _divided(distances, cuts(tree, [wanted])[0], wanted, min_members)
    if clusters.max() + 1 < wanted:  # a cut into fewer may divide no kind into parts that are all too small
        fewer = cuts(tree, range(wanted, 0, -1))
        most = max(fewer, key=lambda cut: np.count_nonzero(np.bincount(cut) >= min_members))
        clusters = max(clusters, _divided(distances, most, wanted, min_members), key=lambda parts: int(parts.max()))
    return clusters


def _divided(distances: Array, clusters: Clusters, wanted: int, min_members: int) -> Clusters:
    """Leave over clusters of too few members, and divide the loosest of the others while it has enough for two."""
    clusters = without_small(clusters, min_members)
    for new in range(int(clusters.max(initial=-1)) + 1, wanted):
        divisible = np.flatnonzero(np.bincount(clusters[clusters >= 0], minlength=1) >= 2 * min_members)
        if not len(divisible):
            break
        members = max(
            (np.flatnonzero(clusters == k) for k in divisible), key=lambda rows: distances[np.ix_(rows, rows)].mean()
        )
        clusters[members[_half(distances[np.ix_(members, members)], min_members)]] = new
    return clusters


def _half(distances: Array, min_members: int) -> NDArray[np.bool_]:
    """Tell which of n movements are in the second of two parts, both of at least `min_members`.

    Each goes with the nearer of the first two large enough in cuts of the tree, else of the two farthest apart.
    """
    n = len(distances)
    tree = average_linkage(distances)
    for count in range(2, n):
        parts = without_small(cuts(tree, [count])[0], min_members)
        if parts.max(initial=-1) >= 1:
            first, second = (distances[:, parts == k].mean(axis=1) for k in (0, 1))
            nearer = np.where(parts == 0, False, np.where(parts == 1, True, second < first))
            return np.asarray(nearer, dtype=bool)
    i, j = np.unravel_index(distances.argmax(), distances.shape)
    nearer = np.zeros(n, dtype=bool)
    nearer[np.argsort(distances[:, j] - distances[:, i], kind="stable")[: n // 2]] = True
    return nearer


def _normalized(similar: Array) -> Array:
    roots = np.sqrt(np.maximum(similar.sum(axis=1), np.finfo(float).tiny))
    return np.asarray(similar / roots[:, None] / roots)


_SLACK = 0.05  # of the adjusted Rand index: a number of clusters this close to the most stable is as stable
_AT_ONCE = 60  # numbers of clusters tried at a time


def count_clusters(distances: Array) -> int:
    """The number of clusters c of an average-linkage tree.

    The stability of c is the mean adjusted Rand index between the c clusters of all movements and those of random
    subsets of four fifths of them (Ben-Hur, Elisseeff, Guyon 2002). Alone it prefers a few large clusters, which
    come again whatever they hold (von Luxburg 2010, section 3), so it only admits: of all c whose stability is
    within 0.05 of the largest, the one with the largest mean silhouette (Rousseeuw 1987) is taken. On bounded distances
    the silhouette is about the share of movements that are clearly nearer to their own cluster.

    Every c from 2 to n / 2 is tried, since a cluster is more than one movement; among many movements a geometric series
    of c first, then those around the best.

    U. von Luxburg, "Clustering stability: an overview", Foundations and Trends in Machine Learning 2, 2010.
    """
    n = len(distances)
    tree = average_linkage(distances)
    most = max(2, n // 2)
    tried = np.geomspace(2, most, _AT_ONCE) if most > _AT_ONCE else np.arange(2.0, most + 1)
    counts = np.unique(tried.round().astype(np.intp))
    best = _best(distances, tree, counts)
    k = int(np.searchsorted(counts, best))
    low, high = counts[max(k - 1, 0)], counts[min(k + 1, len(counts) - 1)]
    if high - low <= 2:
        return best
    around = np.append(np.linspace(low, high, _AT_ONCE).round().astype(np.intp), best)
    return _best(distances, tree, np.unique(around))


def _best(distances: Array, tree: Array, counts: NDArray[np.intp]) -> int:
    fine_first = counts[::-1].tolist()
    clusterings = cuts(tree, fine_first)
    fits = mean_silhouettes(distances, clusterings)
    parts = subsets(len(distances))
    agreement = np.mean([_agreement(distances, clusterings, fine_first, chosen) for chosen in parts], axis=0)
    fits[agreement < agreement.max() - _SLACK] = -np.inf
    return int(fine_first[int(np.argmax(fits))])


def mean_silhouettes(distances: Array, cuts: Sequence[NDArray[np.intp]]) -> Array:
    """Mean silhouette of each clustering; each must be coarser than the one before it.

    With a the mean distance of a movement to its own cluster and b that to the nearest other, ``(b - a) / max(a, b)``,
    and 0 for a movement alone. The sums of distances to a cluster's parts add up to those to the cluster, so the n^2
    distances are read once for all clusterings.

    Source: P. J. Rousseeuw, "Silhouettes: a graphical aid to the interpretation and validation of cluster analysis",
    Journal of Computational and Applied Mathematics 20, 1987.
    """
    sums = _sums_by(distances, cuts[0])
    before, means = cuts[0], []
    for cut in cuts:
        into = np.zeros(sums.shape[1], dtype=np.intp)
        into[before] = cut
        sums, before = _sums_by(sums, into), cut
        means.append(_mean_silhouette(sums, cut))
    return np.array(means)


def _sums_by(columns: Array, into: NDArray[np.intp]) -> Array:
    """Columns (n, m) added up by where each goes, shape (n, c)."""
    order = np.argsort(into, kind="stable")
    starts = np.flatnonzero(np.diff(into[order], prepend=-1))
    return np.asarray(np.add.reduceat(columns[:, order], starts, axis=1))


def _mean_silhouette(sums: Array, cut: NDArray[np.intp]) -> float:
    counts, rows = np.bincount(cut), np.arange(len(cut))
    own = counts[cut]
    a = sums[rows, cut] / np.maximum(own - 1, 1)
    others = sums / counts
    others[rows, cut] = np.inf
    b = others.min(axis=1)
    larger = np.maximum(a, b)
    silhouette = np.where((own > 1) & (larger > 0), (b - a) / np.where(larger > 0, larger, 1.0), 0.0)
    return float(silhouette.mean())


def _agreement(distances: Array, clusterings: list[Clusters], counts: list[int], chosen: NDArray[np.intp]) -> Array:
    """Adjusted Rand index of each number of clusters between all movements and a chosen subset, (c,)."""
    tree = average_linkage(distances[np.ix_(chosen, chosen)])
    again = cuts(tree, [min(count, len(chosen)) for count in counts])
    return np.array([adjusted_rand(a[chosen], b) for a, b in zip(clusterings, again, strict=True)])


def adjusted_rand(a: Clusters, b: Clusters) -> float:
    """Agreement of two clusterings, 1 if the same and 0 on average by chance, in one pass for it is often called.

    Source: L. Hubert, P. Arabie, "Comparing partitions", Journal of Classification 2, 1985, Eq. (5).
    """
    table = np.bincount(a * (int(b.max()) + 1) + b)
    both, in_a, in_b = (_pairs(counts) for counts in (table, np.bincount(a), np.bincount(b)))
    by_chance = in_a * in_b / _pairs(np.array([len(a)]))
    most = 0.5 * (in_a + in_b)
    return 1.0 if most == by_chance else (both - by_chance) / (most - by_chance)


def _pairs(counts: NDArray[np.intp]) -> float:
    return float((counts * (counts - 1)).sum()) / 2.0


_SHARE, _REPEATS = 0.8, 20  # of the movements in each subset, and the number of subsets


def subsets(n: int) -> Iterator[NDArray[np.intp]]:
    """Random subsets of four fifths of n movements, in rising order."""
    random = np.random.default_rng(0)
    size = max(2, round(_SHARE * n))
    for _ in range(_REPEATS):
        yield np.sort(random.choice(n, size, replace=False))


def stabilities(distances: Array, clusters: Clusters, again: Callable[[Array], Clusters]) -> Array:
    """Mean (c,), over subsets, of each cluster's largest Jaccard coefficient with one that `again` makes of a subset.

    Hennig takes 0.75 for a valid, stable cluster, and below 0.5 for none.
    """
    c = int(clusters.max(initial=-1)) + 1
    coefficients = np.full((_REPEATS, c), np.nan)
    for b, chosen in enumerate(subsets(len(distances))):
        own, other = clusters[chosen], again(distances[np.ix_(chosen, chosen)])
        table = overlaps(own, other, c)
        sizes = np.bincount(own[own >= 0], minlength=c)
        union = sizes[:, None] + np.bincount(other[other >= 0], minlength=table.shape[1]) - table
        there = sizes > 0
        coefficients[b, there] = (table[there] / np.maximum(union[there], 1)).max(axis=1, initial=0.0)
    is_finite = np.isfinite(coefficients)
    return np.asarray(np.where(is_finite, coefficients, 0.0).sum(axis=0) / np.maximum(is_finite.sum(axis=0), 1))


def overlaps(a: Clusters, b: Clusters, n_rows: int) -> NDArray[np.intp]:
    """Movements in each cluster of a and each of b, shape (n_rows, clusters of b); -1 is in none."""
    both = (a >= 0) & (b >= 0)
    table = np.zeros((n_rows, int(b.max(initial=-1)) + 1), dtype=np.intp)
    np.add.at(table, (a[both], b[both]), 1)
    return table


def agglomerative(distances: Array, n_clusters: int, min_members: int) -> Clusters:
    """Average linkage cut into `n_clusters`; clusters of fewer than `min_members` are none, -1."""
    clusters = cuts(average_linkage(distances), [min(n_clusters, len(distances))])[0]
    return without_small(clusters, min_members)


def hdbscan(distances: Array, n_clusters: int | None, min_members: int) -> Clusters:
    """Clusters of density that persist longest, none (-1) in between; their number is found.

    Density needs a metric: that of the kernel's space, ``sqrt(2 - 2 K)``, from ``1 - K``. Source: R. Campello, D.
    Moulavi, J. Sander, "Density-based clustering based on hierarchical density estimates", PAKDD 2013.
    """
    from sklearn.cluster import HDBSCAN

    size = min(min_members, len(distances))
    model = HDBSCAN(min_cluster_size=max(2, size), min_samples=max(1, size - 1), metric="precomputed", copy=True)
    return np.asarray(model.fit_predict(np.sqrt(2.0 * np.maximum(distances, 0.0))), dtype=np.intp)


#: Name -> from distances (n, n), a number of clusters and of members to the cluster of each movement, -1 for none.
METHODS: dict[str, Callable[[Array, int, int], Clusters]] = {"agglomerative": agglomerative, "hdbscan": hdbscan}


def without_small(clusters: Clusters, min_members: int) -> Clusters:
    """The same with clusters of fewer members dissolved, and the others counted from 0 again."""
    sizes = np.bincount(clusters)
    numbers = np.full(len(sizes), -1, dtype=np.intp)
    large = np.flatnonzero(sizes >= min_members)
    numbers[large] = np.arange(len(large))
    return np.asarray(numbers[clusters])


def average_linkage(distances: Array) -> Array:
    """Merges (n - 1, 4) of the two clusters whose mean distance is smallest, as SciPy's `linkage` gives them."""
    return np.asarray(linkage(squareform(distances, checks=False), "average"))


def cuts(tree: Array, counts: Sequence[int]) -> list[NDArray[np.intp]]:
    """Clusters 0, 1, ... of each movement for each number of clusters: the first n - c merges are made."""
    rank = np.arange(len(tree), dtype=np.float64)  # of the merges: heights may be equal, ranks are not
    ends = [len(tree) - count for count in counts]
    return [np.asarray(fcluster(tree, end, "monocrit", monocrit=rank), dtype=np.intp) - 1 for end in ends]


def cut_at(tree: Array, height: float) -> NDArray[np.intp]:
    """Clusters of movements whose mean distance does not exceed `height`."""
    return np.asarray(np.unique(fcluster(tree, height, "distance"), return_inverse=True)[1], dtype=np.intp)
