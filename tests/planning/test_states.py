"""States beside the movements of a library: tables by moment and by time, and the commands from them to a plan."""

from __future__ import annotations

import csv
import json
import shutil

import numpy as np
import pytest
import tea_states as tea
from click.testing import CliRunner

import kineme
from kineme import ActionLibrary
from kineme.cli import main
from kineme.errors import DataError, SpecificationError
from kineme.planning import learn_operators, move_to, outside, problem_of, read_state, skill_of, states_of

_CLOCK = 3.0  # seconds from the start of one movement to the next


def run(*arguments):
    """What a command prints."""
    done = CliRunner().invoke(main, [*arguments], prog_name="kineme")
    assert done.exit_code == 0, done.output
    return done.output


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """A folder with a library of the movements of tea, and tables of their states by moment and by time."""
    folder = tmp_path_factory.mktemp("tea")
    states = tea.states()
    u = np.linspace(0, 1, 60)[:, None]
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    bends = {"reach": (0.0, 0.0), "carry": (0.0, 0.2), "scoop": (0.05, -0.1), "stir": (-0.1, -0.05)}
    (folder / "monday").mkdir()
    for k, symbol in enumerate(states.symbols):
        start, goal = states.before[k, :2], states.after[k, :2]
        path = start + (goal - start) * s + np.array(bends[symbol]) * np.sin(np.pi * u) ** 2 * [1, 1] * (1 + u)
        table = np.column_stack((_CLOCK * k + 2.0 * u[:, 0], path))
        np.savetxt(folder / "monday" / f"monday-{k:03d}.csv", table, delimiter=",", header="t,x,z", comments="")
    with ActionLibrary(folder / "actions", create=True) as library:
        library.learn(kineme.read_recordings(folder / "monday"), states.symbols)
    flags = tea.COLUMNS[2:]
    with (folder / "moments.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["movement", "moment", *flags])
        for k in range(len(states)):
            table.writerow([f"monday-{k:03d}.csv", "before", *states.before[k, 2:]])
            table.writerow([f"monday-{k:03d}", "after", *states.after[k, 2:]])
    with (folder / "clock.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["time", "file", *flags])
        for k in range(len(states)):
            table.writerow([_CLOCK * k - 0.2, "monday.csv", *states.before[k, 2:]])
            table.writerow([_CLOCK * k + 2.1, "monday.csv", *states.after[k, 2:]])
    with (folder / "now.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["tip_x [m]", "tip.z", *flags])
        table.writerow([*tea.PLACES["home"], *list(tea.now().values())[2:]])
    return folder


@pytest.fixture(scope="module")
def library(shown):
    with ActionLibrary(shown / "actions", read_only=True) as library:
        yield library


@pytest.mark.parametrize("table", ["moments.csv", "clock.csv"])
def test_both_kinds_of_tables_give_the_true_operators(shown, library, table):
    states = states_of(library, shown / table)
    expected = tea.states()
    assert np.allclose(states.before[:, 2:], expected.before[:, 2:])
    assert np.allclose(states.before[:, :2], expected.before[:, :2], atol=1e-6)
    domain = learn_operators(library, shown / table)
    assert {operator.name: tea.literals(operator) for operator in domain.operators} == tea.TRUE
    assert all(operator.symbol_id.startswith("sym-") for operator in domain.operators)


@pytest.mark.parametrize(("head", "per_second"), [("time", 1), ("time [ms]", 1e3), ("t_us", 1e6), ("stamp_ns", 1e9)])
@pytest.mark.parametrize(("shift", "counts"), [(0.04, True), (0.3, False)])
def test_a_state_within_a_twentieth_of_an_end_is_at_it(library, shift, counts, head, per_second):
    """Cuts are not exact: of 2 s, a twentieth is 0.1 s."""
    times = [per_second * t for t in (-1.0, shift, 2.0 - shift, 2.5)]
    table = {head: times, "lid": [0, 1, 0, 1], "file": ["monday-000"] * 4}
    states = states_of(library, table)
    assert states.missing == {*states.movements[1:].tolist()}
    k = states.columns.index("lid")
    assert (states.before[0, k], states.after[0, k]) == ((1.0, 0.0) if counts else (0.0, 1.0))


def test_a_folder_of_tables_is_read_as_one(shown, library, tmp_path):
    heads, *rows = (shown / "clock.csv").read_text().splitlines()
    heads = heads.replace("file,", "")
    for name, part in (("monday", rows), ("tuesday", rows[:2])):
        lines = [heads, *(row.replace("monday.csv,", "") for row in part)]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines))
    states = states_of(library, tmp_path)
    assert np.array_equal(states.before, states_of(library, shown / "clock.csv").before)
    with pytest.raises(DataError, match="tables of states"):
        states_of(library, shown / "actions")


def test_without_a_table_the_hand_alone_is_known(library):
    domain = learn_operators(library)
    assert tea.literals(domain.operator("carry")) == (
        {"(hand-at ?from)", "(not (hand-at ?to))"}, {"(not (hand-at ?from))", "(hand-at ?to)"},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"movement": ["nobody.csv"], "moment": ["before"], "lid": ["1"]}, "none of the table fits"),
        ({"movement": ["monday-000.csv"], "moment": ["later"], "lid": ["1"]}, "expected before or after"),
        ({"lid": ["1"]}, "expected columns movement and moment, or time"),
        ({"time": ["soon"], "lid": ["1"]}, "expected numbers"),
    ],
)
def test_rows_that_fit_no_movement_are_refused(library, table, message):
    with pytest.raises(DataError, match=message):
        states_of(library, table)


@pytest.mark.parametrize("text", ["", "a\n", "a,a\n1,2\n", "a,b\n1\n", "a,\n1,2\n"])
def test_a_file_that_is_no_table_is_refused(library, tmp_path, text):
    path = tmp_path / "states.csv"
    path.write_text(text)
    with pytest.raises(DataError, match="expected"):
        states_of(library, path)


def test_empty_cells_are_not_known(library):
    cells = {
        "movement": ["monday-000.csv"] * 2,
        "moment": ["before", "after"],
        "lid": ["", "open"],
        "door": ["1", "nan"],
    }
    states = states_of(library, cells)
    k = states.columns.index("lid")
    assert np.isnan(states.before[0, k])
    assert states.words["lid"][int(states.after[0, k])] == "open"
    assert np.isnan(states.after[:, k + 1]).all()


def test_a_library_without_symbols_has_no_states(tmp_path):
    with ActionLibrary(tmp_path / "empty", create=True) as library, pytest.raises(SpecificationError, match="symbols"):
        states_of(library)


def test_the_latest_row_alone_is_the_state_now(shown, tmp_path):
    state = read_state(shown / "now.csv")
    assert (state["hand_x [m]"], state["hand_z"]) == tea.PLACES["home"]
    assert read_state({"door": "open", "cup_x": 0.5, "lid": ""}) == {"door": "open", "cup_x": 0.5}
    for heads, rows in (("time_ms,cup_x,lid", ("0,1,0", "60,,1", "40,3,0")), ("cup_x,lid", ("1,0", ",1"))):
        (tmp_path / "now.csv").write_text("\n".join([heads, *rows]))
        assert read_state(tmp_path / "now.csv") == {"lid": 1.0}


def test_decimal_commas_and_heads_in_capitals_are_read(shown, library, tmp_path):
    heads, *rows = (shown / "clock.csv").read_text().splitlines()
    lines = [row.replace("monday.csv", "monday").replace(",", ";").replace(".", ",") for row in rows]
    (tmp_path / "states.csv").write_text("\n".join([heads.replace(",", ";"), *lines]))
    expected = states_of(library, shown / "clock.csv")
    np.testing.assert_array_equal(states_of(library, tmp_path / "states.csv").before, expected.before)
    domain, now = tea.domain(), tea.now()
    (tmp_path / "now.csv").write_text(f"{';'.join(now).upper()}\n{';'.join(map(str, now.values()))}".replace(".", ","))
    problems = [problem_of(domain, each, "(sweet cup)") for each in (now, read_state(tmp_path / "now.csv"))]
    assert problems[0].facts == problems[1].facts
    for wrong, message in (("0,6", "numbers with a decimal point"), ("shelf", "numbers in the position cup_x")):
        with pytest.raises(DataError, match=message):
            problem_of(domain, now | {"cup_x": wrong}, "(sweet cup)")
        (tmp_path / "states.csv").write_text("\n".join([heads, rows[0].replace(rows[0].split(",")[4], f'"{wrong}"')]))
        with pytest.raises(DataError, match="in the position"):
            states_of(library, tmp_path / "states.csv")
    (tmp_path / "now.csv").write_text("cup_x;cup_z\n0,6;0.1")
    with pytest.raises(DataError, match="one decimal mark"):
        read_state(tmp_path / "now.csv")


def test_a_skill_moves_to_a_new_goal_and_says_what_lies_outside(library):
    skill = skill_of(library, "carry")
    movement = move_to(library, skill, skill.starts[0] + 0.01, skill.goals[0] + 0.02)
    assert np.allclose(movement.positions[0][-1], skill.goals[0] + 0.02, atol=1e-9)
    assert np.allclose(movement.velocities[0][[0, -1]], 0.0, atol=1e-9)
    assert outside(skill, skill.starts[0], skill.goals[0]) == []
    excess = outside(skill, skill.starts[0], skill.goals.max(axis=0) + np.array([0.5, 0.0]))[0]
    assert (excess.what, excess.axis) == ("goal", "x")
    assert excess.distance == pytest.approx(0.5)
    with pytest.raises(SpecificationError, match="2 finite numbers, x, z"):
        outside(skill, [0.0], skill.goals[0])


def test_from_recordings_to_a_plan_in_the_shell(shown, tmp_path, monkeypatch):
    pytest.importorskip("up_aries")
    monkeypatch.chdir(tmp_path)
    actions, tables = str(shown / "actions"), shown
    learned = run("operators", "--library", actions, "--states", str(tables / "clock.csv"), "-o", "tea.pddl")
    assert "needs (hand-at ?at) (spoon_full) (not (sweet ?at))" in learned
    planned = run("plan", "tea.pddl", "--state", str(tables / "now.csv"), "--goal", "(and (sweet cup) (sweet mug))",
                  "--library", actions, "-o", "plan.json", "--plot", "plan.png")  # fmt: skip
    assert "8 steps" in planned
    assert (tmp_path / "plan.png").read_bytes().startswith(b"\x89PNG")
    assert len(json.loads((tmp_path / "plan.json").read_text())["steps"]) == 8
    run("plan", "tea.pddl", "--state", str(tables / "now.csv"), "--goal", "(sweet cup)", "-o", "plan.xml")
    # What a person changes survives learning again, and is not lost where nothing is written.
    text = (tmp_path / "tea.pddl").read_text()
    (tmp_path / "tea.pddl").write_text(text.replace("(sweet ?at)\n", "(sweet ?at) (served ?at)\n", 1))
    again = run("operators", "--library", actions, "--states", str(tables / "clock.csv"), "-o", "tea.pddl", "--force")
    assert "kept 1 edit of a person" in again
    assert "(served ?at)" in (tmp_path / "tea.pddl").read_text()
    shutil.copytree(actions, "fewer")
    run("library", "delete", "stir", "--library", "fewer", "--yes")
    fewer = run("operators", "--library", "fewer", "--states", str(tables / "clock.csv"), "-o", "tea.json", "--force")
    assert "applies to no operator: effect (served ?at) of what was called stir" in fewer
    assert "kept" not in fewer
    with pytest.raises(AssertionError, match="there"):
        run("operators", "--library", actions, "-o", "tea.pddl")
    run("operators", "--library", actions, "-o", "tea.xml")
    assert "<TreeNodesModel>" in (tmp_path / "tea.xml").read_text()
