"""``kineme annotate``, ``find`` and ``correct`` on data sets of an arm."""

from __future__ import annotations

import csv
from types import SimpleNamespace

import pytest
from commands import answer, run, start

import kineme
from kineme.errors import DataError
from kineme.io.lerobot import read as lerobot_read
from kineme.library.annotate import check_symbols
from robot_work import SYMBOLS, write_episodes, write_library


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    """Folder with a data set and a library, and what is when in the set."""
    folder = tmp_path_factory.mktemp("work")
    truth = write_episodes(folder / "set", 6)
    write_library(folder / "actions")
    return folder, truth


@pytest.fixture
def annotated(work, tmp_path):
    """A copy of the library that may change, and the rows of ``kineme annotate``."""
    folder, _ = work
    write_library(tmp_path / "actions")
    run("annotate", folder / "set", "-l", tmp_path / "actions", "-o", tmp_path / "set.csv")
    with (tmp_path / "set.csv").open(newline="", encoding="utf-8") as file:
        return folder / "set", tmp_path / "actions", list(csv.DictReader(file))


def _write(path, rows):
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(rows[0]))
        table.writeheader()
        table.writerows(rows)
    return path


def _rounded(said):
    """An answer whose numbers are rounded: similarities are computed in single precision."""
    rows = [
        {name: round(value, 4) if isinstance(value, float) else value for name, value in row.items()}
        for row in said["annotations"]
    ]
    return said | {"annotations": rows, "seconds": round(said["seconds"], 6)}


def _named(truth, rows):
    """The share of true movements whose middle is annotated with their name; of unknown kinds, with none."""
    right = []
    for number, movements in enumerate(truth):
        own = [row for row in rows if row["place"] == f"episode {number}"]
        for start_time, end, name in movements:
            middle = 0.5 * (start_time + end)
            given = [row["symbol"] for row in own if row["start"] <= middle <= row["end"]]
            right.append((given[0] if given else None) == (name if name in SYMBOLS else None))
    return sum(right) / len(right)


@pytest.mark.soak
def test_a_data_set_is_annotated_the_same_whole_or_in_parts(work, monkeypatch):
    folder, truth = work
    whole = answer("annotate", folder / "set", "-l", folder / "actions")
    assert _named(truth, whole["annotations"]) >= 0.9
    monkeypatch.setattr(lerobot_read, "_NUMBERS", 1000)  # each episode alone
    parts = answer("annotate", folder / "set", "-l", folder / "actions")
    assert _rounded(parts) == _rounded(whole)
    assert whole["seconds"] == pytest.approx(kineme.read_recordings(folder / "set").demonstrations.durations.sum())


def test_an_episode_that_is_damaged_is_said_and_the_others_are_annotated(work, tmp_path):
    import shutil

    import pandas

    folder, _ = work
    shutil.copytree(folder / "set", tmp_path / "set")
    shard = tmp_path / "set" / "data" / "chunk-000" / "file-000.parquet"
    frames = pandas.read_parquet(shard)
    lost = frames.index[(frames["episode_index"] == 2) & (frames["frame_index"] == 7)]
    frames.drop(lost).to_parquet(shard)
    said = answer("annotate", tmp_path / "set", "-l", folder / "actions")
    assert any("episode 2" in problem for problem in said["problems"])
    assert {row["place"] for row in said["annotations"]} == {f"episode {k}" for k in (0, 1, 3, 4, 5)}


def test_hits_are_where_the_symbol_is_the_surest_first(work, tmp_path):
    folder, truth = work
    (folder / "junk.csv").write_text("a,b\nthis is,no recording\n")
    out = tmp_path / "hits.csv"
    said = answer("find", "stir", folder, "-l", folder / "actions", "-o", out)
    hits = said["hits"]
    assert {hit["symbol"] for hit in hits} == {"stir"}
    sure = [(hit["confidence"], hit["p_value"]) for hit in hits]
    assert sure == sorted(sure, reverse=True)
    in_set = [hit for hit in hits if hit["recording"] == "set"]
    for number, movements in enumerate(truth):
        ((start_time, end),) = [row[:2] for row in movements if row[2] == "stir"]
        ((a, b),) = [(hit["start"], hit["end"]) for hit in in_set if hit["place"] == f"episode {number}"]
        assert a == pytest.approx(start_time, abs=0.25)
        assert b == pytest.approx(end, abs=0.25)
    assert len([hit for hit in hits if "actions-shown" in hit["recording"]]) == 3  # the library's own, found again
    assert any(problem.startswith("junk.csv: ") for problem in said["problems"])
    with out.open(newline="", encoding="utf-8") as file:
        assert [float(row["start"]) for row in csv.DictReader(file)] == [hit["start"] for hit in hits]
    both = answer("find", "stir", folder / "set", "--also", "tap", "-l", folder / "actions")["hits"]
    assert [hit for hit in both if hit["symbol"] == "stir"] == [{**hit, "recording": "set"} for hit in in_set]
    assert {hit["symbol"] for hit in both} == {"stir", "tap"}


def test_symbols_that_a_message_does_not_name_are_counted(monkeypatch):
    monkeypatch.setattr("kineme.library.annotate.members_of", lambda store: SimpleNamespace(names="abcdefg"))
    with pytest.raises(DataError, match=r"there are a, b, c, d, e and 2 more$"):
        check_symbols(SimpleNamespace(folder="actions"), ["wave"])


@pytest.mark.soak
def test_the_command_names_near_symbols_and_shows_a_table(work):
    folder, _ = work
    refused = run("find", "stirr", folder / "set", "-l", folder / "actions")
    assert refused.returncode == 1
    assert "there are stir" in refused.stderr
    (folder / "alone").mkdir()
    (folder / "alone" / "junk.csv").write_text("a,b\nthis is,no recording\n")
    nothing = run("find", "tap", folder / "alone", "-l", folder / "actions")
    assert nothing.returncode == 1
    assert "junk.csv" in nothing.stdout + nothing.stderr
    shown = start("find", "tap", folder / "set", "-l", folder / "actions")
    assert shown.returncode == 0
    assert shown.stdout.startswith("6 hits in 6 recordings of")
    assert "set episode 3" in shown.stdout


def test_what_a_person_changed_is_learned_and_nothing_else(annotated, tmp_path):
    source, library, rows = annotated
    rows = [row for row in rows if row["place"] in ("episode 1", "episode 4")]
    unknown = next(row for row in rows if not row["symbol"])
    unknown["symbol"] = "wave"
    known = [row for row in rows if row["symbol"] in SYMBOLS]
    known[0]["symbol"], was = "tap" if known[0]["symbol"] != "tap" else "reach", known[0]["symbol"]
    known[1]["end"] = str(float(known[1]["end"]) - 0.2)
    rows.remove(known[2])
    for row in rows:  # as a person's program writes times
        row["start"], row["end"] = (f"{float(row[name]):.3f}" for name in ("start", "end"))
    table = _write(tmp_path / "corrected.csv", rows)
    arguments = ("correct", source, "--labels", table, "-l", library)
    would = answer(*arguments, "--dry-run")
    assert kineme.ActionLibrary(library, read_only=True).version == 1
    said = answer(*arguments)
    assert {**would, "version": 2, "dry_run": False} == said
    assert sorted(change["kind"] for change in said["changes"]) == ["moved", "named", "removed", "renamed"]
    assert said["learned"] == 3
    assert said["unchanged"] == len(rows) - 3
    assert next(change["was"] for change in said["changes"] if change["kind"] == "renamed") == was
    with kineme.ActionLibrary(library, read_only=True) as actions:
        assert {symbol.name: len(symbol) for symbol in actions.symbols()}["wave"] == 1
        assert len(actions) == 12
    again = answer(*arguments, "--before", tmp_path / "set.csv")
    assert (again["learned"], again["duplicates"]) == (0, 3)
    run("library", "undo", "--library", library)
    assert len(kineme.ActionLibrary(library, read_only=True)) == 9


def test_one_undo_takes_back_what_was_learned_and_what_moved(annotated, tmp_path):
    source, library, rows = annotated
    rows = [row for row in rows if row["place"] == "episode 1"]
    arguments = ("correct", source, "--before", tmp_path / "set.csv", "-l", library, "--labels")
    slip = [dict(row) for row in rows]
    slip[0]["symbol"], slip[1]["symbol"] = "swing", "swing"
    run(*arguments, _write(tmp_path / "slip.csv", slip))
    mended = [dict(row) for row in rows]
    mended[0]["symbol"], mended[1]["symbol"], mended[2]["symbol"] = "sway", "cup", "cup"
    arguments = (*arguments, _write(tmp_path / "mended.csv", mended))
    would = run(*arguments, "--dry-run").stdout.splitlines()
    said = run(*arguments).stdout.splitlines()
    assert said[0].startswith("learned 1 movement, 2 moved to another symbol, 2 new symbols; ")
    assert [said[0].replace("learned", "would learn", 1), *said[1:-1]] == would
    assert said[-1].startswith("take it back: kineme library undo")
    run("library", "undo", "-l", library)
    with kineme.ActionLibrary(library, read_only=True) as actions:
        assert {symbol.name: len(symbol) for symbol in actions.symbols() if symbol.name not in SYMBOLS} == {"swing": 2}
    mended[2]["symbol"] = rows[2]["symbol"]
    _write(tmp_path / "mended.csv", mended)
    said = run(*arguments).stdout
    assert said.startswith("learned 0 movements, 2 moved to another symbol, 2 new symbols; ")
    assert "take it back" in said
    said = run(*arguments).stdout
    assert said.startswith("learned 0 movements, 2 stored already; ")
    assert "take it back" not in said


def test_an_example_that_a_mended_slip_left_is_named(annotated, tmp_path):
    source, library, rows = annotated
    rows = [row for row in rows if row["place"] == "episode 1"]
    arguments = ("correct", source, "--before", tmp_path / "set.csv", "-l", library, "--labels")
    slip = [dict(row) for row in rows]
    slip[0]["symbol"] = "swing"
    assert answer(*arguments, _write(tmp_path / "slip.csv", slip))["contradicted"] == []
    mended = (*arguments, _write(tmp_path / "mended.csv", rows))
    (left,) = answer(*mended)["contradicted"]
    with kineme.ActionLibrary(library, read_only=True) as actions:
        assert [left["movement"]] == actions["swing"].members.tolist()
    assert (left["symbol"], left["now"] or "") == ("swing", rows[0]["symbol"])
    assert left["start"] == pytest.approx(float(rows[0]["start"]), abs=0.01)
    assert "remove what is wrong: kineme library delete --movement ID" in run(*mended).stdout
    rows[0]["end"] = str(float(rows[0]["end"]) - 0.2)
    rows[0]["symbol"] = "swing"
    _write(tmp_path / "mended.csv", rows)  # the same symbol, with other ends
    assert [one["now"] for one in answer(*mended)["contradicted"]] == ["swing"]
    run("library", "delete", "--movement", left["movement"], "--yes", "-l", library)
    assert answer(*mended)["contradicted"] == []


def test_a_named_data_set_says_itself_what_was_annotated(annotated, tmp_path):
    source, library, rows = annotated
    run("annotate", source, "-l", library, "-o", tmp_path / "named")
    rows = [row | {"recording": ""} for row in rows if row["place"] == "episode 0"]
    next(row for row in rows if not row["symbol"])["symbol"] = "wave"
    _write(tmp_path / "named-corrections.csv", rows)  # as the studio writes it beside what it opened
    with kineme.ActionLibrary(library) as actions:  # annotated now, other stretches would be found
        actions.delete("stir")
    said = run("correct", tmp_path / "named", "-l", library)
    assert said.returncode == 0, said.stderr
    assert said.stdout.startswith(f"learned 1 movement, 1 new symbol; {len(rows) - 1} as annotated, not learned")
    assert "kineme library undo" in said.stdout


def test_without_corrections_the_command_says_what_it_looked_for(work):
    folder, _ = work
    refused = run("correct", folder / "set", "-l", folder / "actions")
    assert refused.returncode == 2
    assert "set-corrections.csv" in refused.stderr.replace("\n", "")
