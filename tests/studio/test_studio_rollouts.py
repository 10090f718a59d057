"""New movements over HTTP, and proposals."""

from __future__ import annotations

import io
import json
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Event

import numpy as np
import pytest
from node_runtime import NODE, REASON, ask
from studio_samples import drawing, make_library

from kineme import DMP, ActionLibrary, Demonstrations, Trajectory, read_recordings
from kineme.datasets import load_example
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.dmp.generation.generate import MovementOptions, learn_one
from kineme.dmp.styles.model import learn_styles
from kineme.movements.channels.channel import Channel
from kineme.movements.trajectories.movements import of_channels
from kineme.studio.server import rollout_routes


@pytest.fixture
def symbol(client):
    return client.get("/api/library").json()["symbols"][2]["id"]


def _rollout(client, what, **wanted):
    answer = client.post("/api/rollout", json={"what": what, **wanted})
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_a_symbol_moves_as_demonstrated_and_to_another_goal(client, symbol):
    moved = _rollout(client, {"symbol": symbol})
    assert moved["times"][-1] == pytest.approx(1.5)
    assert (
        len(moved["times"]) == len(moved["positions"]) == len(moved["velocities"]) == len(moved["accelerations"]) >= 200
    )
    assert np.abs(np.array(moved["positions"][0]) - drawing(2, seed=0)[1][0]).max() < 0.2
    recorded = np.array(moved["recorded"])  # of the recording that moves, which the first of the symbol need not be
    assert len(recorded) <= 64
    np.testing.assert_allclose(recorded[[0, -1]], [moved["start"], moved["goal"]], atol=1e-3)
    other = _rollout(client, {"symbol": symbol}, start=[1.0, 2.0], goal=[3.0, -1.0], duration=4.0, rate=50)
    assert other["positions"][0] == pytest.approx([1.0, 2.0])
    assert other["positions"][-1] == pytest.approx([3.0, -1.0])
    assert other["times"][-1] == pytest.approx(4.0)
    assert (other["goal"], other["warnings"]) == ([3.0, -1.0], [])


def test_an_angle_is_taken_in_the_turn_of_the_recording_as_in_the_shell(open_studio, tmp_path):
    """A goal of 59 degrees is 419 where the joint turned from 173 to 419; one that is dragged stays where it is."""
    t = np.linspace(0, 1.2, 60)
    yaw = 172.9 + 246.3 * t / 1.2
    table = np.column_stack((t, 0.3 * t, (yaw + 180) % 360 - 180))
    np.savetxt(tmp_path / "yaw.csv", table, delimiter=",", header="t,x,yaw [deg]", comments="")
    with ActionLibrary(tmp_path / "yaw", create=True) as library:
        library.learn(read_recordings(tmp_path / "yaw.csv").demonstrations, ["turn"])
    client, what = open_studio(tmp_path / "yaw"), {"movement": 1}
    shown, goal = _rollout(client, what), [0.3, 59.0]
    turned = _rollout(client, what, goal=goal, start=[0.0, -187.0])
    assert (turned["goal"], turned["positions"][0][1]) == ([0.3, 419.0], pytest.approx(173.0))
    assert turned["positions"][-1] == pytest.approx([0.3, 419.0])
    assert np.ptp(turned["positions"], axis=0)[1] == pytest.approx(np.ptp(shown["positions"], axis=0)[1], rel=0.05)
    assert turned["warnings"] == [
        "start -187 of yaw [deg] is taken as 173, in the turn of the recording",
        "goal 59 of yaw [deg] is taken as 419, in the turn of the recording",
    ]
    saved = client.post("/api/export", json={"what": what, "goal": goal, "format": "json"}).json()
    assert np.array(saved["positions"])[-1][1] == pytest.approx(419.0)
    dragged = _rollout(client, what, goal=goal, in_turn=False)
    assert (dragged["goal"], dragged["warnings"]) == (goal, [])
    assert dragged["positions"][-1] == pytest.approx(goal)


def test_it_passes_via_points_at_their_time(client, symbol):
    moved = _rollout(client, {"symbol": symbol}, via=[[0.7, [0.4, 0.9]], [0.3, [0.5, 0.5]]], rate=1000)
    times, positions = np.array(moved["times"]) / moved["times"][-1], np.array(moved["positions"])
    for share, point in ((0.3, [0.5, 0.5]), (0.7, [0.4, 0.9])):
        assert positions[np.abs(times - share).argmin()] == pytest.approx(point, abs=0.01)
    far = _rollout(client, {"symbol": symbol}, via=[[0.5, [90.0, 90.0]]])
    assert any("via point" in warning or "passes" in warning for warning in far["warnings"])


def test_rollouts_do_not_wait_for_each_other_and_each_has_its_own_warnings(client, symbol, monkeypatch):
    around, entered, may_go = rollout_routes._around, Event(), Event()

    def slow(learned, options, balls):
        if options.goal is not None:
            entered.set()
            assert may_go.wait(300)
        return around(learned, options, balls)

    monkeypatch.setattr(rollout_routes, "_around", slow)
    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(_rollout, client, {"symbol": symbol}, goal=[3.0, -1.0])
        assert entered.wait(300)
        far = _rollout(client, {"symbol": symbol}, via=[[0.5, [100.0, 100.0]]])
        may_go.set()
        assert first.result()["warnings"] == []
    assert "outside what was demonstrated" in far["warnings"][0]


@pytest.mark.parametrize("formulation", list(FORMULATIONS))
@pytest.mark.parametrize("aside", [0.0, 0.001, 0.03, -0.03])
def test_it_goes_around_balls_and_meets_its_via_points(client, symbol, formulation, aside):
    body = {"formulation": formulation, "rate": 1000}
    shown = np.array(_rollout(client, {"symbol": symbol}, **body)["positions"])
    size = np.ptp(shown, axis=0).max()
    along = shown[len(shown) // 2 + 1] - shown[len(shown) // 2 - 1]
    away = along[::-1] * [-1, 1] / np.linalg.norm(along)
    balls = [
        {"center": (shown[round(share * len(shown))] + aside * size * away).tolist(), "radius": 0.05 * size}
        for share in (0.5, 0.75)
    ]
    via = [[0.6, (shown[round(0.6 * len(shown))] + 0.05 * size).tolist()]]
    moved = _rollout(client, {"symbol": symbol}, obstacles=balls, via=via, **body)
    path = np.array(moved["positions"])
    for ball in balls:
        assert np.linalg.norm(shown - ball["center"], axis=1).min() < ball["radius"]
        assert np.linalg.norm(path - ball["center"], axis=1).min() >= ball["radius"]
    assert moved["warnings"] == []
    reached = path[np.abs(np.array(moved["times"]) - 0.6 * moved["times"][-1]).argmin()]
    assert np.linalg.norm(reached - via[0][1]) < 0.005 * size
    np.testing.assert_allclose(path[[0, -1]], shown[[0, -1]], atol=1e-6 * size)


def test_a_point_within_a_ball_is_met_and_it_says_by_how_much_the_ball_is_touched(client, symbol):
    shown = np.array(_rollout(client, {"symbol": symbol})["positions"])
    size = np.ptp(shown, axis=0).max()
    via = [[0.5, (shown[100] + 0.03 * size).tolist()]]
    ball = {"center": shown[100].tolist(), "radius": 0.05 * size}
    moved = _rollout(client, {"symbol": symbol}, obstacles=[ball], via=via)
    path = np.array(moved["positions"])
    assert np.linalg.norm(path[100] - via[0][1]) < 0.002 * size
    gap = np.linalg.norm(path - ball["center"], axis=1).min()
    assert moved["warnings"] == [
        f"the movement passes {gap:.3g} from the middle of obstacle 1, whose radius is {ball['radius']:.3g}: "
        "move the obstacle, or the point that lies in it"
    ]
    without = _rollout(client, {"symbol": symbol}, via=via)["positions"]
    np.testing.assert_allclose(path, without, atol=1e-9 * size)  # there is no way around, and none is sought
    around_start = {"center": shown[0].tolist(), "radius": size}
    assert "whose radius is" in _rollout(client, {"symbol": symbol}, obstacles=[around_start])["warnings"][-1]


@pytest.mark.skipif(NODE is None, reason=REASON)
def test_the_page_lets_it_move_as_the_server_does(client, folder, symbol):
    """In every formulation: elsewhere, through via points, slower; and so does a style."""
    values = [0.5 * value for value in client.get(f"/api/library/symbols/{symbol}/styles").json()["highest"]]
    whats = [({"symbol": symbol}, formulation) for formulation in FORMULATIONS]
    whats += [({"movement": 5}, None), ({"style": {"symbol": symbol, "values": values}}, None)]
    via = [[0.3, [0.5, 0.5]], [0.71, [0.6, 0.9]]]
    elsewhere = {"start": [0.3, 0.1], "goal": [1.5, -1.0]}
    wanted = [{}, elsewhere, {**elsewhere, "duration": 4.0}, {**elsewhere, "via": via}]
    questions, answers = [], []
    for what, formulation in whats:
        body = {"what": what, "formulation": formulation}
        document = client.post("/api/primitive", json=body).json()
        for wish in wanted:
            questions.append({"ask": "primitive", "document": document, "wish": {**wish, "samples": 201}})
            answers.append(_rollout(client, **body, **wish))
    for got, said in zip(ask(None, questions), answers, strict=True):
        for name in ("times", "positions", "velocities", "accelerations"):
            exact = np.array(said[name])
            np.testing.assert_allclose(got[name], exact, atol=2e-6 * np.abs(exact).max(), rtol=0, err_msg=name)
        assert got["positions"][-1] == pytest.approx(said["goal"], abs=1e-9)


def test_what_only_the_server_lets_move_is_not_sent(client, tmp_path, open_studio):
    times, positions = drawing(1)
    turn = np.sqrt(np.column_stack((1 - 0.1 * times, 0 * times, 0 * times, 0.1 * times)))
    table = np.column_stack((times > 0.7, positions, times, turn))
    channels = (
        Channel("grip", "discrete", ("grip",)),
        *(Channel(axis, "position", (axis,), "m") for axis in "xyz"),
        Channel("q", "orientation", ("qw", "qx", "qy", "qz"), None, "wxyz"),
    )
    plain = Demonstrations.from_arrays([table, table * [1, 1.1, 1.1, 1.1, 1, 1, 1, 1]], None, [times] * 2)
    with ActionLibrary(tmp_path / "channels", create=True) as library:
        library.learn(Demonstrations.of_movements(of_channels(plain.movements, channels)), ["grasp"] * 2)
    other = open_studio(tmp_path / "channels")
    assert other.post("/api/primitive", json={"what": {"movement": 1}}).json() is None
    moved = _rollout(other, {"movement": 1})
    # Start and goal are of these columns, as Move asks again.
    assert moved["columns"] == ["x", "y", "z", "qw", "qx", "qy", "qz"]
    there = {name: moved[name] for name in ("start", "goal")} | {"via": [[0.5, moved["positions"][100]]]}
    again = _rollout(other, {"movement": 1}, **there, obstacles=[{"center": moved["positions"][60], "radius": 0.1}])
    assert np.shape(again["positions"]) == np.shape(moved["positions"])
    assert client.post("/api/primitive", json={"what": {"movement": 99}}).status_code == 404


def test_formulations_differ(client, symbol):
    paths = [
        _rollout(client, {"symbol": symbol}, goal=[5.0, 5.0], formulation=formulation)["positions"]
        for formulation in FORMULATIONS
    ]
    assert all(np.abs(np.array(paths[0]) - np.array(other)).max() > 0.01 for other in paths[1:])


def test_a_stored_movement_moves_too(client):
    moved = _rollout(client, {"movement": 5})
    times, positions = drawing(1, seed=1)
    exact = np.stack([np.interp(moved["times"], times, positions[:, k]) for k in range(2)], axis=1)
    assert np.abs(np.array(moved["positions"]) - exact).max() < 0.05 * np.ptp(positions)


def test_styles_lie_between_the_members(client, folder, symbol):
    styles = client.get(f"/api/library/symbols/{symbol}/styles").json()
    with ActionLibrary(folder, read_only=True) as library:
        model = learn_styles(library.primitives("kind 2"))
    assert styles["highest"] == pytest.approx(model.highest.tolist())
    moved = _rollout(client, {"style": {"symbol": symbol, "values": [0.0] * len(styles["lowest"])}})
    assert moved["recorded"] is None
    assert styles["formulation"] == "bio-inspired"
    assert len(moved["positions"]) >= 200
    outside = {"what": {"style": {"symbol": symbol, "values": [99.0] * len(styles["lowest"])}}}
    assert client.post("/api/rollout", json=outside).status_code == 400


WRONG = [
    {"what": {}},
    {"what": {"symbol": "x", "movement": 1}},
    {"what": {"symbol": "sym-none"}},
    {"what": {"movement": 99}},
    {"what": {"movement": 1}, "goal": [1.0]},
    {"what": {"movement": 1}, "goal": [1e300, 0.0]},
    {"what": {"movement": 1}, "duration": 0},
    {"what": {"movement": 1}, "rate": 1e9},
    {"what": {"movement": 1}, "duration": 1e-300},
    {"what": {"movement": 1}, "formulation": "none"},
    {"what": {"movement": 1}, "via": [[1.5, [0.0, 0.0]]]},
    {"what": {"movement": 1}, "via": [[0.5, [0.0]]]},
    {"what": {"movement": 1}, "obstacles": [{"center": [0.0]}]},
    {"what": {"movement": 1}, "obstacles": [{"center": [0.0, 1.0]}, {"center": [0.0]}]},
    {"what": {"movement": 1}, "obstacles": [{"center": [0.0, 1.0], "radius": -1}]},
]


@pytest.mark.parametrize("body", WRONG, ids=json.dumps)
def test_what_cannot_move_is_refused(client, body):
    answer = client.post("/api/rollout", json=body)
    assert 400 <= answer.status_code < 500, answer.text
    assert "expected" in answer.json()["error"] or "name" in answer.json()["error"]


@pytest.mark.parametrize("ending", ["csv", ".csv", "json", "npz", "parquet"])
def test_a_movement_is_saved_in_every_format(client, symbol, ending):
    client.post(f"/api/library/symbols/{symbol}/rename", json={"name": 'w/av\r\ne é"'})
    answer = client.post("/api/export", json={"what": {"symbol": symbol}, "goal": [1.0, 1.0], "format": ending})
    assert answer.status_code == 200, answer.text
    name = ending.lstrip(".")
    assert answer.headers["content-disposition"] == (
        f"attachment; filename=\"w_av__e___.{name}\"; filename*=UTF-8''w_av__e_%C3%A9_.{name}"
    )
    if name == "csv":
        table = np.genfromtxt(io.StringIO(answer.text), delimiter=",", names=True)
        assert (table["x"][-1], table["y"][-1]) == pytest.approx((1.0, 1.0))


def test_unknown_formats_are_refused(client, symbol):
    answer = client.post("/api/export", json={"what": {"symbol": symbol}, "format": "../../etc"})
    assert answer.status_code == 400
    assert "expected a file ending in one of .csv" in answer.json()["error"]


@pytest.fixture
def unlabeled(tmp_path, open_studio):
    folder = make_library(tmp_path / "unlabeled")
    with ActionLibrary(folder) as library:
        library.learn([Trajectory(*drawing(k, seed=i)) for k in (11, 12) for i in range(6)])
    return open_studio(folder)


def test_those_who_wait_for_proposals_keep_nobody_else_waiting(unlabeled, monkeypatch):
    studio, may_go, searches = unlabeled.app.state.studio, Event(), []
    proposes = studio.library.propose

    def slow():
        searches.append(1)
        assert may_go.wait(300)
        return proposes()

    monkeypatch.setattr(studio.library, "propose", slow)
    with ThreadPoolExecutor(12) as pool, ThreadPoolExecutor(1) as others:
        waiting = [pool.submit(unlabeled.get, "/api/proposals") for _ in range(12)]
        while not searches:
            time.sleep(0.01)
        time.sleep(0.2)  # until all wait
        other = others.submit(unlabeled.get, "/api/library/history")
        try:
            assert other.result(200).status_code == 200
        finally:
            may_go.set()
        answers = [future.result() for future in waiting]
    assert len(searches) == 1
    assert {answer.status_code for answer in answers} == {200}
    assert len({answer.text for answer in answers}) == 1


def test_proposals_are_named_or_rejected(unlabeled):
    client = unlabeled
    proposals = client.get("/api/proposals").json()["proposals"]
    assert [len(proposal["members"]) for proposal in proposals] == [6, 6]
    assert proposals[0]["medoid"] in proposals[0]["members"]
    version = client.post(f"/api/proposals/{proposals[0]['id']}/accept", json={"name": "new"}).json()["version"]
    assert version == client.get("/api/library").json()["version"]
    shown = {symbol["name"]: symbol for symbol in client.get("/api/library").json()["symbols"]}
    assert (shown["new"]["n_members"], shown["new"]["prototype"]) == (6, proposals[0]["medoid"])
    assert [proposal["id"] for proposal in client.get("/api/proposals").json()["proposals"]] == [proposals[1]["id"]]
    gone = client.post(f"/api/proposals/{proposals[0]['id']}/accept", json={"name": "again"})
    assert gone.status_code == 409
    assert client.post(f"/api/proposals/{proposals[1]['id']}/reject").status_code == 200
    assert client.get("/api/proposals").json()["proposals"] == []
    client.post("/api/library/undo")
    client.post("/api/library/undo")
    assert client.get("/api/library").json()["unlabeled"] == 12


def test_a_bend_that_is_not_enough_gets_wider():
    """Beside two obstacles on a wave, the first bends still touch them."""
    (wave,) = load_example("gestures")[34:35]
    places = [([3.6517, 0.2421], 1.2599), ([1.757, 1.1048], 1.1606)]
    balls = [rollout_routes.Obstacle(center=center, radius=radius) for center, radius in places]
    options = MovementOptions(meet_goal=True, rate=200 / wave.duration)
    assert rollout_routes._around(learn_one(wave, DMP()), options, balls)[1] == []
