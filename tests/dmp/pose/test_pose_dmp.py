"""Orientations and poses, learned and moved again, against the literal equations, slerp and the plain DMP."""

import numpy as np
import pytest
from hypothesis import given
from scipy.integrate import solve_ivp

import kineme
from kineme.errors import DegenerateMovementError, SpecificationError, TrajectoryError
from kineme.orientation import PoseDMP, angle_between, conjugate, exp, log, product, slerp
from rotation_samples import carry, minimum_jerk, random_quaternions, seeds, tumble, turn

PATH = kineme.DMP(fit="trajectory", n_basis=80)
SPECIFICATIONS = {
    "bio-inspired": kineme.DMP(fit="forcing", n_basis=80),
    "original": kineme.DMP("original", fit="forcing", n_basis=80),
    "trajectory": PATH,
    "default": kineme.DMP(),
}


@pytest.fixture(scope="module")
def poses():
    return PoseDMP(PATH).learn([carry(seed) for seed in range(6)])


@pytest.mark.parametrize("specification", SPECIFICATIONS)
@given(seeds)
def test_replay_is_the_demonstration_within_a_share_of_its_turn(specification, seed):
    demo = tumble(seed)
    again = PoseDMP(SPECIFICATIONS[specification]).learn([demo]).rollout(n_samples=len(demo))
    np.testing.assert_allclose(np.linalg.norm(again.orientations, axis=-1), 1, atol=1e-12)
    tolerance = {"trajectory": 1e-4, "default": 1e-3}.get(specification, 0.02)
    assert angle_between(again.orientations[0], demo).max() < tolerance * np.ptp(again.tangent.positions)


@pytest.mark.parametrize("angle", [4.0, 6.0, 20.0])
def test_turns_beyond_pi_are_replayed(angle):
    demo, _ = turn(angle)
    primitives = PoseDMP(PATH).learn([demo])
    again = primitives.rollout(n_samples=len(demo)).orientations[0]
    assert angle_between(again, demo).max() < 1e-5 * angle
    asked = primitives.rollout(start=-demo[0], goal=-demo[-1], n_samples=len(demo)).orientations[0]
    assert angle_between(asked, again).max() < 1e-12


def test_a_turn_at_constant_angular_velocity_is_slerp():
    start, end = random_quaternions(3, 2)
    share = np.linspace(0, 1, 101)
    movement = PoseDMP(PATH).learn([slerp(start, end, share)]).rollout(n_samples=101)
    assert angle_between(movement.orientations[0], slerp(start, end, share)).max() < 2e-5
    omega = log(product(end, conjugate(start)))
    np.testing.assert_allclose(movement.angular_velocities[0, 5:-5], np.tile(omega, (91, 1)), atol=0.02)


@given(seeds)
def test_every_goal_is_reached(seed):
    primitives = PoseDMP().learn([tumble(seed)])
    goals = random_quaternions(seed + 1, 4)
    movement = primitives.rollout(goal=goals, settle=1e-6)
    assert angle_between(movement.orientations[:, -1], goals).max() < 2e-6
    starts = random_quaternions(seed + 2, 4)
    movement = primitives.rollout(start=starts, goal=goals, duration=3.0)
    assert angle_between(movement.orientations[:, 0], starts).max() < 1e-12


@given(seeds)
def test_either_sign_of_every_quaternion_gives_the_same_movement(seed):
    demo, goal = tumble(seed), random_quaternions(seed)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (len(demo), 1))
    one = PoseDMP().learn([demo]).rollout(goal=goal).orientations
    other = PoseDMP().learn([demo * signs]).rollout(goal=-goal).orientations
    assert angle_between(one, other).max() < 1e-10


def exponential_jacobian(e):
    """d/de of ``exp(e / 2)`` as a 4 x 3 matrix; another way to it than the library's."""
    t = np.linalg.norm(e) / 2
    n = e / (2 * t)
    across = (np.eye(3) - np.outer(n, n)) * np.sin(t) / t + np.outer(n, n) * np.cos(t)
    return 0.5 * np.vstack((-np.sin(t) * n, across))


@pytest.mark.parametrize("new_goal", [False, True])
def test_rollout_solves_the_equations_of_koutras_and_doulgeri(new_goal):
    """State (q, z) with e = 2 log(g conj(q)), tau z' = -K e - D z + forcing, tau e' = z, q = conj(exp(e)) g.

    Their e is minus our p, so is its forcing; Eq. (4) takes the place of their spring-damper.
    """
    dmp, tau = kineme.DMP(), 2.0
    demo = tumble(5)
    primitives = PoseDMP(dmp).learn([demo])
    g = product(exp([0.3, -0.2, 0.1]), demo[-1]) if new_goal else demo[-1]
    movement = primitives.rollout(goal=g, duration=tau, n_samples=101)
    W = -primitives.tangent.scaled_weights[0]
    e0 = log(product(g, conjugate(demo[0])))

    def equations(t, state):
        q, z = state[:4], state[4:]
        e = log(product(g, conjugate(q)))
        s = dmp.basis.phase(np.array([t / tau]))
        forcing = W @ dmp.basis.design(np.array([t / tau]))[0] + dmp.K * s * e0
        q_rate = product(conjugate(exponential_jacobian(e) @ z / tau), g)
        return np.concatenate((q_rate, (-dmp.K * e - dmp.D * z + forcing) / tau))

    state = np.concatenate((demo[0], -primitives.tangent.velocities[0]))
    end = 0.9 * tau  # their Jacobian is 0/0 at the goal
    times = movement.times[0][movement.times[0] <= end]
    solved = solve_ivp(equations, (0, end), state, t_eval=times, rtol=1e-10, atol=1e-12).y.T
    assert angle_between(solved[:, :4], movement.orientations[0, : len(times)]).max() < 1e-8


def test_velocities_are_the_derivatives_of_the_poses_to_second_order(poses):
    def errors(n_samples):
        movement = poses.rollout(goal=carry(9)[-1], duration=2.0, n_samples=n_samples)
        h, q = movement.times[0, 1], movement.orientations
        q_rate = (q[:, 2:] - q[:, :-2]) / (2 * h)
        omega = 2 * product(q_rate, conjugate(q[:, 1:-1]))[..., 1:]
        rates = (movement.velocities[:, 2:] - movement.velocities[:, :-2]) / (2 * h)
        return [
            np.abs(omega - movement.angular_velocities[:, 1:-1]).max(),
            np.abs(rates - movement.accelerations[:, 1:-1]).max(),
        ]

    ratio = np.array(errors(1601)) / np.array(errors(3201))
    assert (np.abs(np.log2(ratio) - 2) < 0.1).all()


def test_positions_of_poses_are_those_of_the_plain_dmp(poses):
    demos = [carry(seed) for seed in range(6)]
    plain = PATH.learn([demo[:, :3] for demo in demos])
    new = {"start": carry(20)[0], "goal": carry(21)[-1]}
    movement = poses.rollout(**new, duration=3.0, n_samples=120)
    expected = plain.rollout(new["start"][:3], new["goal"][:3], 3.0, n_samples=120)
    np.testing.assert_allclose(movement.poses[..., :3], expected.positions, atol=1e-13)
    np.testing.assert_allclose(movement.velocities[..., :3], expected.velocities, atol=1e-12)
    np.testing.assert_allclose(movement.accelerations[..., :3], expected.accelerations, atol=1e-11)
    turned = PoseDMP(PATH).learn([demo[:, 3:] for demo in demos])
    alone = turned.rollout(new["start"][3:], new["goal"][3:], 3.0, n_samples=120)
    np.testing.assert_allclose(movement.orientations, alone.orientations, atol=1e-12)


def test_a_batch_is_its_movements_one_by_one(poses):
    goals = np.stack([carry(30 + i)[-1] for i in range(6)])
    batch = poses.rollout(goal=goals, rate=50.0, duration=2.0)
    for i in range(6):
        one = poses[i].rollout(goal=goals[i], rate=50.0, duration=2.0)
        for field in ("poses", "velocities", "accelerations"):
            np.testing.assert_allclose(getattr(batch, field)[i], getattr(one, field)[0], atol=1e-10)
    assert len(poses[2:].rollout()) == 4
    spread = poses[0].rollout(goal=goals)
    np.testing.assert_allclose(spread.poses[3], poses[0].rollout(goal=goals[3]).poses[0], atol=1e-12)


@pytest.mark.parametrize("specification", ["bio-inspired", "original"])
@given(seeds)
def test_another_mounting_of_the_tool_keeps_the_angular_velocities(specification, seed):
    demo, c = turn(2.0, seed)[0], random_quaternions(seed)
    primitives = PoseDMP(SPECIFICATIONS[specification]).learn([demo])
    shown = primitives.rollout()
    moved = primitives.rollout(start=product(demo[0], c), goal=product(demo[-1], c))
    np.testing.assert_allclose(moved.angular_velocities, shown.angular_velocities, atol=1e-9)
    assert angle_between(moved.orientations, product(shown.orientations, c)).max() < 1e-11


def test_the_duration_changes_the_tempo_and_not_the_path(poses):
    slow, fast = poses.rollout(duration=5.0), poses.rollout(duration=0.5)
    np.testing.assert_allclose(slow.poses, fast.poses, atol=1e-12)
    np.testing.assert_allclose(10 * slow.velocities, fast.velocities, atol=1e-9)


def test_initial_velocities_are_in_the_world_frame(poses):
    wish = np.array([0.1, 0.2, -0.3, 0.5, -0.4, 0.3])
    movement = poses.rollout(goal=carry(9)[-1], duration=2.0, velocity=wish)
    np.testing.assert_allclose(movement.velocities[:, 0], np.tile(wish, (6, 1)), atol=1e-12)


def test_what_is_moved_again_can_be_learned_again(poses):
    again = poses.rollout(n_samples=150)
    assert again.trajectories.n_dims == 7
    relearned = PoseDMP(PATH).learn(again.trajectories).rollout(n_samples=150)
    assert angle_between(relearned.orientations, again.orientations).max() < 1e-4
    np.testing.assert_allclose(poses.goals[:, :3], [carry(seed)[-1, :3] for seed in range(6)])
    assert angle_between(poses.starts[:, 3:], [carry(seed)[0, 3:] for seed in range(6)]).max() < 1e-12


def test_preprocessing_is_applied_once_and_to_rotation_vectors():
    demo = np.repeat(tumble(0), [40] + [1] * 99 + [40], axis=0)  # badly cropped: rest before and after
    trimmed = PoseDMP(kineme.DMP(preprocessing=(kineme.TrimRest(0.005),))).learn([demo])
    assert trimmed.tangent.durations[0] < 0.75
    assert trimmed.tangent.dmp.preprocessing == ()
    np.testing.assert_array_equal(trimmed.tangent.goals, 0)


@given(seeds)
def test_the_original_formulation_refuses_a_new_axis(seed):
    q0, c = random_quaternions(seed, 2)
    demo = product(exp(minimum_jerk(101)[:, None] * [0, 0, 1.5]), q0)
    primitives = PoseDMP(kineme.DMP("original")).learn([demo])
    primitives.rollout(start=product(demo[0], c), goal=product(demo[-1], c))  # rounding makes no new axis
    with pytest.raises(DegenerateMovementError, match=r"trajectory 0: expected .* g != x0 in dimension 0"):
        primitives.rollout(goal=product(exp([0.5, 0, 2.0]), q0))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"goal": [1.0, 0, 0, 0]}, r"expected goal of shape \(7,\) or \(n, 7\), got shape \(4,\)"),
        ({"start": [0, 0, 0, 2.0, 0, 0, 0]}, r"start: quaternion at index \[0\]: .* got norm 2 "),
        ({"goal": np.tile(carry(0)[0], (4, 1))}, "expected one or equally many .* got 6 primitives, 6 start, 4 goal"),
        ({"velocity": [1.0, 0, 0]}, r"expected velocity of shape \(6,\) or \(n, 6\), got shape \(3,\)"),
        ({"velocity": np.zeros((4, 6))}, "expected one or equally many .* got 6 primitives, 4 velocity"),
    ],
)
def test_wrong_wishes_are_refused(poses, options, message):
    with pytest.raises(TrajectoryError, match=message):
        poses.rollout(**options)


def test_wrong_specifications_are_refused():
    with pytest.raises(SpecificationError, match=r"expected dmp to be a kineme\.DMP, got 'original'"):
        PoseDMP("original")
    scaled = PoseDMP(kineme.DMP("amplitude-scaled"))
    with pytest.raises(
        SpecificationError, match=r'"decoupled" for poses, got "amplitude-scaled".* learn positions and orientations'
    ):
        scaled.learn([carry(0)])
    assert len(scaled.learn([tumble(0)])) == 1


def test_what_does_not_turn_is_refused_by_name():
    still = np.tile(random_quaternions(0), (20, 1))
    with pytest.raises(TrajectoryError, match="trajectory 1: expected a movement, got 20 samples at the same place"):
        PoseDMP().learn([tumble(0), still])


def test_an_end_velocity_is_that_at_the_goal_which_is_then_met_exactly(poses):
    goals = np.concatenate((np.random.default_rng(4).normal(size=(6, 3)), random_quaternions(4, 6)), axis=1)
    rates = np.array([0.1, -0.2, 0.3, 0.5, -0.4, 0.2])
    movement = poses.rollout(goal=goals, end_velocity=rates)
    np.testing.assert_allclose(movement.positions[:, -1, :3], goals[:, :3], atol=1e-9)
    assert angle_between(movement.orientations[:, -1], goals[:, 3:]).max() < 1e-7
    np.testing.assert_allclose(movement.velocities[:, -1], np.tile(rates, (6, 1)), atol=1e-6)
