"""Points that turn together: hands, markers, joints of a body, as columns one after the other."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kineme
from kineme.errors import SpecificationError
from kineme.kernels.pair_distances import pair_distances, shapes_of
from kineme.kernels.procrustes import Procrustes
from kineme.movements.channels.channel import Channel
from kineme.movements.channels.detect import point_names
from kineme.recognition import RotationPrior
from kineme.similarity.bounds import fit_bases, log_bounds, reduce_features
from kineme.similarity.comparison import fit_comparison
from kineme.similarity.describe import describe, feature_rows, squared_distances
from kineme.similarity.specification import ComparisonSpecification

HANDS = [f"{side}_hand_{axis}" for side in ("left", "right") for axis in "xyz"]


def draw_points(n_points, n_dims, seed, n_classes=4, each=3):
    """Movements of J points: each class has its own waves, each movement a little noise; labels."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0, 1, 70)[:, None, None]
    arrays, labels = [], []
    for label in range(n_classes):
        waves = rng.normal(size=(3, 1, n_points, n_dims))
        path = sum(wave * np.sin(np.pi * (k + 1) * u + wave) for k, wave in enumerate(waves))
        for _ in range(each):
            noise = 0.1 * rng.normal(size=(1, n_points, n_dims)) * np.sin(5 * u)
            arrays.append((path + noise).reshape(len(u), -1))
            labels.append(str(label))
    return kineme.Demonstrations.from_arrays(arrays, labels)


def turned(demos, n_points, n_dims, seed, axis=None):
    """Each movement turned as a whole, by any angle about the axis, or by any rotation."""
    rng = np.random.default_rng(seed)
    arrays = []
    for demo in demos:
        if n_dims == 2:
            angle = rng.uniform(-np.pi, np.pi)
            R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        elif axis is not None:
            R = Rotation.from_rotvec(rng.uniform(-np.pi, np.pi) * np.array(axis)).as_matrix()
        else:
            R = Rotation.random(rng=rng).as_matrix()
        arrays.append((demo.positions.reshape(-1, n_points, n_dims) @ R.T).reshape(len(demo.positions), -1))
    return kineme.Demonstrations.from_arrays(arrays, demos.labels, [demo.times for demo in demos])


@pytest.mark.parametrize(("n_points", "n_dims"), [(2, 2), (2, 3), (5, 3), (21, 3)])
def test_points_that_turn_together_are_the_same_movement(n_points, n_dims, monkeypatch):
    if n_points > 2:  # to compile for these alone would take longer than all else
        monkeypatch.setenv("KINEME_COMPILED", "never")
    demos = draw_points(n_points, n_dims, seed=n_points)
    like = ComparisonSpecification(max_angle=np.pi, points=n_points)
    squares = squared_distances(describe(demos, like), describe(demos, like))
    comparison, references = fit_comparison(like, demos, np.asarray(demos.labels))
    moved = describe(turned(demos, n_points, n_dims, seed=1), comparison)
    own = np.einsum("rii->ri", comparison.similarity.squared_distances(moved, references.described))
    assert own.max() < 2e-4 * np.median(squares)


def test_the_distance_is_that_after_the_best_rotation_of_all_points():
    """By singular values of the covariance of (T J, 3), Kabsch's algorithm."""
    J, S, rng = 4, 30, np.random.default_rng(2)
    A, B = rng.normal(size=(2, 5, J, 3, S))
    procrustes = Procrustes(3, np.pi, None, J)
    found = procrustes.squared_distances(procrustes.prepare(A.reshape(5, -1)), procrustes.prepare(B.reshape(5, -1)))
    for i in range(5):
        for j in range(5):
            x, y = (P.transpose(0, 2, 1).reshape(-1, 3) for P in (A[i], B[j]))
            R = Rotation.align_vectors(x, y)[0]
            assert found[i, j] == pytest.approx(((x - R.apply(y)) ** 2).sum(), rel=1e-9)


def test_rotations_of_points_lie_along_the_diagonal():
    J, rng = 3, np.random.default_rng(3)
    x = rng.normal(size=(1, J, 3, 20))
    R = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()
    y = np.einsum("ab,njbs->njas", R.T, x)
    procrustes = Procrustes(3, np.pi, None, J)
    matrices = procrustes.rotations(x.reshape(1, -1), y.reshape(1, -1))
    np.testing.assert_allclose(matrices[0], np.kron(np.eye(J), R), atol=1e-9)
    rows = rng.normal(size=(4, J * 3 * 7))
    np.testing.assert_array_equal(procrustes.by_points(procrustes.by_coordinates(rows)), rows)


@pytest.mark.parametrize(("n_points", "n_dims"), [(2, 2), (3, 2), (2, 3)])
def test_pairs_turned_by_the_rotation_of_one_point_are_those_turned_by_all(n_points, n_dims, monkeypatch):
    rng = np.random.default_rng(4)
    d = n_points * n_dims
    A, B = (shapes_of(np.cumsum(rng.normal(size=(3, d, 40)), axis=2)) for _ in range(2))
    one = np.linalg.qr(rng.normal(size=(3, 3, n_dims, n_dims)))[0].astype(np.float32)
    whole = np.zeros((3, 3, d, d), np.float32)
    for k in range(0, d, n_dims):
        whole[:, :, k : k + n_dims, k : k + n_dims] = one
    results = []
    for compiled in ("always", "never"):
        monkeypatch.setenv("KINEME_COMPILED", compiled)
        results += [pair_distances(A, B, one), pair_distances(A, B, whole)]
    for result in results[1:]:
        np.testing.assert_allclose(result, results[0], rtol=2e-4, atol=1e-5)


def test_bounds_of_points_hold():
    demos = draw_points(2, 3, seed=5)
    like = ComparisonSpecification(points=2)
    comparison, references = fit_comparison(like, demos, np.asarray(demos.labels))
    how = comparison.specification
    rows = feature_rows(demos, how)[: len(how.by_rows)]
    reduced = reduce_features(fit_bases(rows, 6, 4), rows, 6)
    similarity = comparison.similarity
    bounds = log_bounds(similarity, reduced, reduced)
    by_rows = similarity.by_rows(len(rows))
    squares = similarity.squared_distances(references.described, references.described)[: len(rows)]
    exact = by_rows.logs_at(squares)
    assert (bounds >= np.log(np.mean(np.exp(exact), axis=0)) - 1e-4).all()


def test_names_of_columns_tell_the_points():
    def channels(*names):
        return tuple(Channel(name, "position", (name,)) for name in names)

    assert point_names(channels(*HANDS)) == ("left_hand", "right_hand")
    joints = ("Wrist.X", "Wrist.Y", "Elbow.X", "Elbow.Y", "Tip.X", "Tip.Y")
    assert point_names(channels(*joints)) == ("wrist", "elbow", "tip")
    assert point_names(channels("x", "y", "z")) == point_names(None) == ()
    for pair in ("acc gyro", "Accelerometer Gravity", "LeftAccelerometer RightAccelerometer", "imu1 imu2"):
        assert point_names(channels(*[f"{kind}.{axis}" for kind in pair.split() for axis in "xyz"])) == ()
    assert point_names(channels(*HANDS[:4], HANDS[5], HANDS[4])) == ()
    assert point_names(channels(*[f"joint{k}" for k in range(6)])) == ()
    for heads, names in (
        ("Left (X),Left (Y),Right (X),Right (Y)", ("left", "right")),
        ("x,y,z,x_2,y_2,z_2", ("xyz", "2")),
        ("lx,ly,lz,rx,ry,rz", ("l", "r")),
        ("left_hand_px,left_hand_py,right_hand_px,right_hand_py", ("left_hand", "right_hand")),
        ("x1_px,y1_px,x2_px,y2_px", ("1_px", "2_px")),
        ("x,y,z,rx,ry,rz", ()),
        ("x,y,z,rot_x,rot_y,rot_z", ()),
        ("ax,ay,az,gx,gy,gz", ()),
        ("left_px,left_py,left_pz,left_vx,left_vy,left_vz", ()),
    ):
        assert point_names(channels(*heads.split(","))) == names


def test_names_that_say_other_points_are_warned_of(tmp_path):
    """Columns of two hands in turn are no points one after the other; and `points` counts, whatever the names say."""
    demos = draw_points(2, 3, seed=15)
    for i, demo in enumerate(demos):
        table, head = np.column_stack((demo.times, demo.positions)), ",".join(["time", *HANDS])
        np.savetxt(tmp_path / f"{i:02d}.csv", table, delimiter=",", header=head, comments="")
    in_turn = [HANDS[k] for k in (0, 3, 1, 4, 2, 5)]
    apart = kineme.read_recordings(tmp_path, columns=in_turn).demonstrations
    with pytest.warns(UserWarning, match=r"compared as none: order them as \['left_hand_x', 'left_hand_y'"):
        assert kineme.Recognizer().fit(apart, demos.labels).n_points_ == 1
    named = kineme.read_recordings(tmp_path).demonstrations
    with pytest.warns(UserWarning, match="names of columns say 2 points, and 3 are compared, as points=3 says"):
        kineme.Recognizer(points=3).fit(named, demos.labels)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for points in (None, 1, 2):
            kineme.Recognizer(points=points).fit(named, demos.labels)


def test_hands_with_names_turn_as_one_without_an_option(tmp_path):
    """In a recognizer and in a library: turned about the vertical by up to 60 degrees, all are recognized."""
    demos = draw_points(2, 3, seed=6, each=4)
    rng = np.random.default_rng(7)

    def written(movements, folder):
        folder.mkdir()
        for i, movement in enumerate(movements):
            R = Rotation.from_rotvec([0, 0, rng.uniform(-np.pi / 3, np.pi / 3)]).as_matrix()
            x = (movement.positions.reshape(-1, 2, 3) @ R.T).reshape(-1, 6)
            table = np.column_stack((movement.times, x))
            np.savetxt(folder / f"{i:02d}.csv", table, delimiter=",", header=",".join(["time", *HANDS]), comments="")
        return kineme.read_recordings(folder).demonstrations

    shown, fresh = written(demos[::4], tmp_path / "shown"), written(demos, tmp_path / "fresh")
    labels = np.asarray(demos.labels)
    recognizer = kineme.Recognizer().fit(shown, labels[::4])
    assert recognizer.n_points_ == 2
    assert (recognizer.predict(fresh) == labels).mean() >= 0.95
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(shown, labels[::4])
    with kineme.ActionLibrary(tmp_path / "actions") as library:
        answers = library.recognize(fresh)
    for answer, expected in zip(answers, recognizer.recognize(fresh), strict=True):
        assert answer.ranked[0] == expected.ranked[0]
        assert answer.nearest[0].similarity == pytest.approx(expected.nearest[0].similarity, abs=1e-4)


def test_movements_turned_about_the_vertical_are_recognized():
    demos = draw_points(2, 3, seed=8, each=3)
    fresh = turned(demos, 2, 3, seed=9, axis=(0, 0, 1))
    prior = RotationPrior(vertical=(0, 0, 1))
    recognizer = kineme.Recognizer(points=2, rotation_prior=prior).fit(demos[::3])
    assert (recognizer.predict(fresh) == np.asarray(demos.labels)).mean() >= 0.95


@pytest.mark.parametrize("n_dims", [2, 3])
def test_the_angle_of_points_is_that_of_their_common_rotation(n_dims):
    demos = draw_points(2, n_dims, seed=13, n_classes=2, each=1)
    R = np.eye(n_dims)
    R[:2, :2] = [[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]]
    moved = demos[0].positions @ np.kron(np.eye(2), R).T
    transform = kineme.Recognizer(points=2).fit(demos).recognize(moved).transform
    assert transform.angle == pytest.approx(0.4, abs=1e-3)
    np.testing.assert_allclose(transform.rotation, np.kron(np.eye(2), R), atol=1e-3)


def test_many_points_are_compared_by_four(monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", "never")
    demos = draw_points(21, 3, seed=10)
    recognizer = kineme.Recognizer(points=21).fit(demos)
    described = recognizer.references_.described
    assert described.pairs.shapes.n_dims == 12
    assert described.n_dims == 63
    assert (recognizer.predict(demos) == np.asarray(demos.labels)).all()
    # Movements that are asked for are compared by the same four points, not by their own:
    own = [recognizer.log_similarity(demo).max() for demo in recognizer.demonstrations_[:3]]
    np.testing.assert_allclose(own, 0, atol=1e-4)
    symbols = kineme.anchoring.assign(demos[:3], recognizer).labels
    assert list(symbols) == list(demos.labels[:3])


def test_many_columns_that_are_no_points_are_compared_by_twelve(monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", "never")
    demos = draw_points(21, 3, seed=12)
    recognizer = kineme.Recognizer(points=1).fit(demos)
    assert recognizer.references_.described.pairs.shapes.n_dims == 12
    assert (recognizer.predict(demos) == np.asarray(demos.labels)).all()


@pytest.mark.parametrize(("points", "n_dims"), [(2, 5), (4, 6), (3, 3)])
def test_columns_that_are_no_points_are_refused(points, n_dims, tmp_path):
    demos = draw_points(1, n_dims, seed=11)
    with pytest.raises(SpecificationError, match=rf"expected {2 * points} or {3 * points} columns, .* got {n_dims}"):
        kineme.Recognizer(points=points).fit(demos)
    words, recognizer = rf"expected {2 * points} or {3 * points} columns", kineme.Recognizer(points=points)
    library = kineme.ActionLibrary(tmp_path / "actions", create=True, recognizer=recognizer)
    with library, pytest.raises(SpecificationError, match=words):
        library.learn(demos)


def test_points_are_a_number_and_names_tell_them_by_themselves():
    with pytest.raises(SpecificationError, match=r"points to be a number, got .*names tell the points by themselves"):
        kineme.Recognizer(points=["left_hand", "right_hand"]).fit(draw_points(2, 3, seed=14))
