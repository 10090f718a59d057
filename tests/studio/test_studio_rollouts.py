"""New movements over HTTP, and proposals."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from studio_samples import drawing, make_library

from kineme import ActionLibrary, Trajectory
from kineme.primitives.discrete.formulations import FORMULATIONS
from kineme.primitives.styles.learn import learn_styles


@pytest.fixture
def symbol(client):
    return client.get("/api/library").json()["symbols"][2]["id"]


def _rollout(client, what, **wanted):
    answer = client.post("/api/rollout", json={"what": what, **wanted})
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_a_symbol_moves_as_demonstrated_and_to_another_goal(client, symbol):
    made = _rollout(client, {"symbol": symbol})
    assert made["times"][-1] == pytest.approx(1.5)
    assert len(made["times"]) == len(made["positions"]) == len(made["velocities"]) == len(made["accelerations"]) >= 200
    assert np.abs(np.array(made["positions"][0]) - drawing(2, seed=0)[1][0]).max() < 0.2
    other = _rollout(client, {"symbol": symbol}, start=[1.0, 2.0], goal=[3.0, -1.0], duration=4.0, rate=50)
    assert other["positions"][0] == pytest.approx([1.0, 2.0])
    assert other["positions"][-1] == pytest.approx([3.0, -1.0])
    assert other["times"][-1] == pytest.approx(4.0)
    assert (other["goal"], other["warnings"]) == ([3.0, -1.0], [])


def test_it_passes_via_points_at_their_time(client, symbol):
    made = _rollout(client, {"symbol": symbol}, via=[[0.7, [0.4, 0.9]], [0.3, [0.5, 0.5]]], rate=1000)
    times, positions = np.array(made["times"]) / made["times"][-1], np.array(made["positions"])
    for share, point in ((0.3, [0.5, 0.5]), (0.7, [0.4, 0.9])):
        assert positions[np.abs(times - share).argmin()] == pytest.approx(point, abs=0.01)
    far = _rollout(client, {"symbol": symbol}, via=[[0.5, [90.0, 90.0]]])
    assert any("via point" in one or "passes" in one for one in far["warnings"])


def test_it_goes_around_balls_or_says_that_it_does_not(client, symbol):
    shown = np.array(_rollout(client, {"symbol": symbol})["positions"])
    middle, size = shown[100], np.ptp(shown, axis=0).max()
    ball = {"center": (middle + 0.001 * size).tolist(), "radius": 0.05 * size}
    made = _rollout(client, {"symbol": symbol}, obstacles=[ball])
    gap = np.linalg.norm(np.array(made["positions"]) - ball["center"], axis=1).min()
    assert gap >= ball["radius"] or made["warnings"]
    assert np.linalg.norm(shown - ball["center"], axis=1).min() < ball["radius"]
    around_start = {"center": shown[0].tolist(), "radius": size}
    assert "whose radius is" in _rollout(client, {"symbol": symbol}, obstacles=[around_start])["warnings"][0]


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_operators_give_what_a_rollout_gives_or_there_are_none(client, symbol, formulation):
    asked = {"what": {"symbol": symbol}, "formulation": formulation}
    found = client.post("/api/rollout/operators", json=asked).json()
    assert (found is None) == (formulation in {"original", "amplitude-scaled"})
    if found is None:
        return
    start, goal = [1.0, 2.0], [3.0, -1.0]
    made = client.post("/api/rollout", json={**asked, "start": start, "goal": goal}).json()
    a, b, c = (np.array(found[name]) for name in ("of_start", "of_goal", "constant"))
    path = a[:, None] * start + b[:, None] * goal + c
    exact = np.array(made["positions"])
    ours = np.stack([np.interp(found["times"], made["times"], exact[:, k]) for k in range(2)], axis=1)
    assert np.abs(path - ours).max() < 1e-3 * np.ptp(exact)


def test_formulations_differ(client, symbol):
    paths = [
        _rollout(client, {"symbol": symbol}, goal=[5.0, 5.0], formulation=one)["positions"] for one in FORMULATIONS
    ]
    assert all(np.abs(np.array(paths[0]) - np.array(other)).max() > 0.01 for other in paths[1:])


def test_a_stored_movement_moves_too(client):
    made = _rollout(client, {"movement": 5})
    times, positions = drawing(1, seed=1)
    exact = np.stack([np.interp(made["times"], times, positions[:, k]) for k in range(2)], axis=1)
    assert np.abs(np.array(made["positions"]) - exact).max() < 0.05 * np.ptp(positions)


def test_styles_lie_between_the_members(client, folder, symbol):
    styles = client.get(f"/api/library/symbols/{symbol}/styles").json()
    with ActionLibrary(folder, read_only=True) as library:
        model = learn_styles(library.primitives("kind 2"))
    assert styles["highest"] == pytest.approx(model.highest.tolist())
    made = _rollout(client, {"style": {"symbol": symbol, "values": [0.0] * len(styles["lowest"])}})
    assert len(made["positions"]) >= 200
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


def test_proposals_are_named_or_rejected(unlabeled):
    client = unlabeled
    found = client.get("/api/proposals").json()["proposals"]
    assert [len(one["members"]) for one in found] == [6, 6]
    assert found[0]["medoid"] in found[0]["members"]
    version = client.post(f"/api/proposals/{found[0]['id']}/accept", json={"name": "new"}).json()["version"]
    assert version == client.get("/api/library").json()["version"]
    shown = {one["name"]: one for one in client.get("/api/library").json()["symbols"]}
    assert (shown["new"]["n_members"], shown["new"]["prototype"]) == (6, found[0]["medoid"])
    assert [one["id"] for one in client.get("/api/proposals").json()["proposals"]] == [found[1]["id"]]
    gone = client.post(f"/api/proposals/{found[0]['id']}/accept", json={"name": "again"})
    assert gone.status_code == 409
    assert client.post(f"/api/proposals/{found[1]['id']}/reject").status_code == 200
    assert client.get("/api/proposals").json()["proposals"] == []
    client.post("/api/library/undo")
    client.post("/api/library/undo")
    assert client.get("/api/library").json()["unlabeled"] == 12
