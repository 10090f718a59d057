"""Action chunks, and the interface that fancy_gym calls."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

from kineme.errors import SpecificationError, TrajectoryError

torch = pytest.importorskip("torch", reason="the extra torch is not installed")

from tensor_movements import DURATION, RATE, learned, module, tensors  # noqa: E402 - after the package that may be missing
from torch.autograd import gradcheck  # noqa: E402

import kineme  # noqa: E402
from kineme.torch import ActionChunk, Trajectories  # noqa: E402


def test_chunks_begin_where_the_robot_is_and_zeros_stay_there():
    chunk = ActionChunk(module(), scale=0.5)
    assert chunk.n_outputs == 14
    outputs, x, v = tensors((3, 14), (3, 2), (3, 2))
    actions = chunk(outputs, x, v)
    assert torch.allclose(actions[:, 0], x)
    assert torch.allclose(chunk(outputs, x, v, derivative=1)[:, 0], v)
    stay = chunk(torch.zeros(3, 14, dtype=x.dtype), x)
    assert torch.allclose(stay, x[:, None].expand_as(stay))
    assert gradcheck(chunk, tuple(part.clone().requires_grad_() for part in (outputs, x, v)), fast_mode=True)


def test_demonstrated_chunks_are_outputs_to_train_on():
    chunk = ActionChunk(module(), scale=0.5)
    outputs, x, v = tensors((3, 14), (3, 2), (3, 2))
    actions = chunk(outputs, x, v)
    again = chunk(chunk.encode(actions), x, chunk.primitive.initial_velocity(actions))
    assert torch.allclose(again, actions, atol=2e-3 * float(actions.abs().max()))


def test_a_policy_learns_through_its_chunks():
    torch.manual_seed(0)
    chunk = ActionChunk(module(dtype=torch.float32))
    policy = torch.nn.Linear(2, chunk.n_outputs)
    targets, x = torch.randn(64, 2), torch.zeros(64, 2)
    optimizer = torch.optim.Adam(policy.parameters(), lr=0.05)
    for _ in range(100):
        optimizer.zero_grad()
        loss = (chunk(policy(targets), x)[:, -1] - targets).square().mean()
        loss.backward()
        optimizer.step()
    assert loss < 1e-3


@pytest.mark.soak
def test_the_policy_of_the_example_learns_to_hit_moving_goals(tmp_path):
    script = Path(__file__).parents[2] / "examples" / "moving_goal_policy.py"
    names = runpy.run_path(str(script))
    policy, misses = names["train"](20, n=32)
    assert misses[-1] < 0.4 * misses[0]
    names["draw"](policy, misses).savefig(tmp_path / "policy.png")


def test_what_no_chunk_can_be_made_of_is_refused():
    with pytest.raises(SpecificationError, match='got "original"'):
        ActionChunk(module("original"))
    with pytest.raises(SpecificationError, match="expected scale"):
        ActionChunk(module(), scale=0.0)
    with pytest.raises(TrajectoryError, match=r"expected outputs \(..., 14\), got \(3, 13\)"):
        ActionChunk(module())(torch.zeros(3, 13), torch.zeros(3, 2))


def test_the_black_box_wrapper_of_fancy_gym_is_served():
    """The calls are those of its `get_trajectory`, with arrays, on an environment that follows every position."""
    mp = module(dtype=torch.float32)
    trajectories, dt = Trajectories(mp, low=-2.0, high=2.0), 1 / RATE
    trajectories.set_duration(0.7, dt)
    low, high = trajectories.get_params_bounds()
    assert (low.shape, float(low[0]), float(high[-1])) == ((14,), -2.0, 2.0)
    assert not hasattr(trajectories.phase_gn, "tau_bound")
    params = np.random.default_rng(0).uniform(-1, 1, 14)
    start = position = np.array([0.2, -0.1])
    velocity, executed = np.zeros(2), []
    trajectories.reset()
    for steps in (8, 10, 10):
        trajectories.set_params(np.clip(params, low.numpy(), high.numpy()))
        trajectories.set_initial_conditions(np.array(len(executed) * dt), position, velocity)
        trajectories.set_duration(0.7, dt)
        positions, velocities = (part.numpy() for part in (trajectories.get_traj_pos(), trajectories.get_traj_vel()))
        assert len(positions) == 28 - len(executed)
        executed += list(positions[:steps])
        position, velocity = positions[steps - 1], velocities[steps - 1]
    numbers = torch.tensor(params, dtype=torch.float32).reshape(2, 7)
    whole = mp(numbers[:, :-1], torch.tensor(start), numbers[:, -1])
    assert np.abs(np.array(executed) - whole[1:].numpy()).max() < 1e-5


@pytest.mark.filterwarnings("ignore")  # fancy_gym itself is warned by gymnasium
def test_fancy_gym_itself_moves_a_mass_and_replans():
    pytest.importorskip("fancy_gym", reason="fancy_gym is not installed: its own wrapper does not run")
    import gymnasium as gym
    from fancy_gym.black_box.black_box_wrapper import BlackBoxWrapper
    from fancy_gym.black_box.controller.pos_controller import PosController
    from fancy_gym.black_box.raw_interface_wrapper import RawInterfaceWrapper

    class Mass(gym.Env):
        """A mass that is where it is sent, a step of 1 / RATE later."""

        observation_space = action_space = gym.spaces.Box(-10.0, 10.0, (2,), np.float64)
        dt = 1 / RATE

        def reset(self, *, seed=None, options=None):
            self.positions, self.velocity = [np.array([0.2, -0.1])], np.zeros(2)
            return self.positions[0], {}

        def step(self, action):
            self.velocity = (action - self.positions[-1]) / self.dt
            self.positions.append(action)
            return action, 0.0, False, False, {}

    class Raw(RawInterfaceWrapper):
        @property
        def context_mask(self):
            return np.ones(2, dtype=bool)

        @property
        def current_pos(self):
            return self.env.unwrapped.positions[-1]

        @property
        def current_vel(self):
            return self.env.unwrapped.velocity

    mp, mass = module(), Mass()
    environment = BlackBoxWrapper(
        Raw(mass), Trajectories(mp, low=-2.0, high=2.0), PosController(), DURATION,
        replanning_schedule=lambda position, velocity, observation, action, t: t % 10 == 0, condition_on_desired=True,
    )  # fmt: skip
    assert environment.action_space.shape == (14,)
    params = np.random.default_rng(0).uniform(-1, 1, 14)
    environment.reset(seed=0)
    lengths = [environment.step(params)[4]["trajectory_length"] for _ in range(3)]
    assert lengths == [10, 10, 8]
    numbers = torch.tensor(params).reshape(2, 7)
    planned = mp(numbers[:, :-1], torch.tensor(mass.positions[0]), numbers[:, -1])
    assert np.abs(np.array(mass.positions) - planned.numpy()).max() < 1e-6


def test_trajectories_have_the_duration_and_rate_that_are_set():
    trajectories = Trajectories(kineme.torch.Primitive.of(learned(n=1), dtype=torch.float64))
    trajectories.set_params(torch.zeros(5, 18))
    trajectories.set_initial_conditions(torch.zeros(5), torch.ones(5, 2), torch.zeros(5, 2))
    assert trajectories.get_traj_pos().shape == (5, 49, 2)
    trajectories.set_duration(2.0, 0.01)
    assert trajectories.get_traj_vel().shape == (5, 200, 2)
    trajectories.set_duration(None, 0.01)
    assert trajectories.get_traj_vel().shape == (5, 80, 2)
    with pytest.raises(TrajectoryError, match="expected 18 parameters, got 17"):
        trajectories.set_params(torch.zeros(17))
    trajectories.reset()
    with pytest.raises(SpecificationError, match="expected set_params"):
        trajectories.get_traj_pos()


def test_samples_are_those_after_the_initial_time():
    primitive = kineme.torch.Primitive(dims=2, n_weights=8, rate=100, duration=1.0)
    trajectories = Trajectories(primitive)
    trajectories.set_params(torch.zeros(18))
    trajectories.set_duration(1.0, 0.01)
    for time, n_after in ((0.012, 99), (0.018, 99), (0.29, 71), (0.999, 1), (1.0, 0)):
        trajectories.set_initial_conditions(time, torch.zeros(2), torch.zeros(2))
        assert len(trajectories.get_traj_pos()) == n_after
    with pytest.raises(SpecificationError, match="expected the same initial time for all of a batch"):
        trajectories.set_initial_conditions(torch.tensor([0.1, 0.5]), torch.zeros(2, 2), torch.zeros(2, 2))
