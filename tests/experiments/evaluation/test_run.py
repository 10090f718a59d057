"""Whole evaluations: the same seed gives the same bytes, in one process or in two."""

import json
import re

import pytest

import kineme
from kineme_experiments.evaluation import methods
from kineme_experiments.evaluation.conclusions import best_rival, conclusion, verdict
from kineme_experiments.evaluation.conditions import UNTOUCHED
from kineme_experiments.evaluation.data import DataSet
from kineme_experiments.evaluation.methods import METHODS
from kineme_experiments.evaluation.optional import optional_module, why_missing
from kineme_experiments.evaluation.protocols import PROTOCOLS
from kineme_experiments.evaluation.results import Results
from kineme_experiments.evaluation.rows import to_csv
from kineme_experiments.evaluation.run import Runner, draw_protocol, evaluate
from kineme_experiments.evaluation.trials import Settings, shots_label
from soaking import SOAK

SMALL = ["few-shot", "robustness"], ["kineme", "euclidean"] if SOAK else ["euclidean"]
PLAN = (
    [name for name, one in PROTOCOLS.items() if name != "earliness" and not one.by_person],
    ["kineme", "euclidean", "paper"],
)


def run(data, out, plan=PLAN, seed=0, processes=1):
    def progress(items, total):
        done = list(items)
        assert len(done) == total
        return done

    return evaluate(data, plan, Settings(2, seed, (1, 2)), out, Runner(processes, progress))


def without_times(path):
    content = json.loads(path.read_text())
    del content["seconds"]
    return json.dumps(content)


@pytest.fixture(scope="module")
def data(small):
    return DataSet("small & <simple>", small, {"wave/broken.csv": "expected <numbers>"})


@pytest.fixture(scope="module")
def done(data, tmp_path_factory):
    return run(data, tmp_path_factory.mktemp("evaluation"))


def test_the_same_seed_gives_the_same_bytes_and_another_does_not(data, done, tmp_path):
    plan = PLAN if SOAK else SMALL
    html, numbers = done.files if SOAK else run(data, tmp_path / "first", plan).files
    again = run(data, tmp_path / "again", plan)
    assert again.files[0].read_bytes() == html.read_bytes()
    assert without_times(again.files[1]) == without_times(numbers)
    other = run(data, tmp_path / "other", plan, seed=1)
    assert without_times(other.files[1]) != without_times(numbers)


@pytest.mark.soak
def test_two_processes_give_what_one_gives(data, tmp_path):
    plan = ["few-shot", "user-independent"] if SOAK else ["few-shot"], ["kineme", "euclidean"]
    files = [run(data, tmp_path / str(k), plan, processes=k).files for k in (1, 2)]
    assert without_times(files[0][1]) == without_times(files[1][1])


def test_the_page_needs_no_other_file_and_escapes_names(done):
    html = done.files[0].read_text()
    assert re.findall(r'(?:src|href)="(?!data:)', html) == []
    assert "<script" not in html
    assert "small &amp; &lt;simple&gt;" in html
    assert "<simple>" not in html
    assert "<numbers>" not in html
    assert "expected &lt;numbers&gt;" in html
    assert html.count("<img") == 3  # mean ranks, few shots and robustness
    assert html.index('class="verdict"') < html.index("<img") < html.index("<table>")
    for name in PLAN[0]:
        assert PROTOCOLS[name].title in html
    for name in PLAN[1]:
        assert METHODS[name].title in html


def test_the_numbers_are_complete(done):
    content = json.loads(done.files[1].read_text())
    assert content["seed"] == 0
    assert content["shots"] == [1, 2]
    assert set(content["protocols"]) == set(PLAN[0])
    assert set(content["seconds"]) == {"whole", *PLAN[0]}
    assert content["versions"]["kineme"] == kineme.__version__
    assert content["left_out"] == {"wave/broken.csv": "expected <numbers>"}
    for protocol, by_method in content["protocols"].items():
        assert list(by_method) == ["kineme", "paper", "euclidean"]  # in the order of the table of methods
        for measures in (one for outcome in by_method.values() for one in outcome.values()):
            for values in measures.values():
                n = 16 if protocol == "leave-one-out" else 2
                assert len(values["by_split"]) == n
                assert values["min"] <= values["mean"] <= values["max"]


def test_a_method_that_is_not_installed_is_reported(data, tmp_path, monkeypatch):
    monkeypatch.setitem(methods.METHODS, "dtw", methods.Method("DTW 1-NN", lambda _: None, needs="no_such_package"))
    result = run(data, tmp_path, (["few-shot"], ["kineme", "dtw"]))
    assert result.results.absent == {"dtw": "not installed: no_such_package"}
    assert json.loads(result.files[1].read_text())["absent_methods"] == result.results.absent
    assert "not installed: no_such_package" in result.files[0].read_text()


def test_a_method_that_breaks_on_import_is_reported(tmp_path, monkeypatch):
    (tmp_path / "brittle.py").write_text("import numpy\nnumpy.trapz_of_old")
    monkeypatch.syspath_prepend(tmp_path)
    assert "cannot be imported: AttributeError" in why_missing("brittle")
    assert why_missing("json.decoder") == ""


def test_the_group_to_install_is_named():
    with pytest.raises(kineme.errors.SpecificationError, match=r"'no_such_package', .* pip install 'kineme\[rivals\]'"):
        optional_module("no_such_package.part")


def test_a_protocol_that_nobody_can_answer_is_reported(data, tmp_path):
    result = run(data, tmp_path, (["few-shot", "earliness"], ["paper"]))
    assert result.results.skipped == {"earliness": "none of the methods can classify movements before their end"}


def outcome(absent=None, **accuracies):
    """Results of all methods that are not absent; what is not named is never right."""
    absent = absent or {}
    names = [name for name in METHODS if name not in absent]
    measured = {name: {UNTOUCHED: {"accuracy": [accuracies.get(name, 0.0)]}} for name in names}
    return Results({"few-shot": measured}, {}, absent, {})


def test_a_rival_that_is_ahead_is_named():
    found = outcome(kineme=0.9, dtw=0.95, euclidean=0.9, hmm=0.97)
    assert conclusion("few-shot", found) == "Ahead of kineme: as recorded (0.900): HMM 0.970, DTW 1-NN 0.950."
    assert verdict(found) == "A rival is ahead of kineme in 1 of 1 cells; each table lists its own."
    del found.outcomes["few-shot"]["kineme"]
    assert conclusion("few-shot", found) == ""
    assert "Nothing is concluded" in verdict(found)


def test_the_best_rival_is_that_with_the_smallest_lag_over_the_cells_that_both_have():
    assert best_rival(outcome(kineme=0.9, dtw=0.7, hmm=0.8)) == (
        "The best rival is HMM: 0.800 on average over 1 cell, where kineme has 0.900."
    )
    assert best_rival(Results({"few-shot": {}}, {}, {}, {})) == ""


def test_that_no_rival_is_ahead_is_said_only_if_all_ran():
    found = outcome(kineme=0.9, dtw=0.9004)  # equal in three digits
    assert conclusion("few-shot", found).startswith(
        "No rival is ahead of kineme in this table. Rivals here: paper, original"
    )
    assert verdict(found) == "No rival is ahead of kineme in any of 1 cells."
    del found.outcomes["few-shot"]["hmm"]
    for said in (conclusion("few-shot", found), verdict(found)):
        assert "No rival is ahead" not in said
        assert "None of the rivals that took part is ahead" in said
        assert "HMM (not asked for)" in said


@pytest.mark.parametrize("theirs", [0.95, 0.8])
def test_a_rival_that_did_not_take_part_is_named_beside_what_is_concluded(theirs):
    absent = {"dtw": "not installed: dtaidistance", "hmm": "not installed: hmmlearn"}
    found = outcome(absent, kineme=0.9, euclidean=theirs)
    said = conclusion("few-shot", found)
    assert ("Ahead of kineme" in said) is (theirs > 0.9)
    assert ("None of the rivals that took part is ahead" in said) is (theirs < 0.9)
    assert said.endswith(". Not compared: DTW 1-NN (not installed: dtaidistance); HMM (not installed: hmmlearn).")
    assert "Not all rivals ran everywhere: DTW 1-NN (not installed" in verdict(found)


def test_rows_hold_every_value_with_the_person_who_is_tested(of_people, tmp_path):
    done = run(
        of_people, tmp_path, (["few-shot", "user-independent", "anchoring"], ["kineme", "euclidean", "plus-cloud"])
    )
    assert {row.person for row in done.rows if row.protocol == "user-independent"} == {"ann", "bob"}  # two splits
    assert {row.person for row in done.rows if row.protocol == "few-shot"} == {""}
    for row in done.rows:
        [condition] = [one for one in done.results.conditions(row.protocol) if one.label == row.condition]
        values = done.results.outcomes[row.protocol][row.method][condition][row.measure]
        assert min(abs(row.value - value) for value in values) < 1e-5
    n_values = sum(
        len(values)
        for by_method in done.results.outcomes.values()
        for outcome in by_method.values()
        for measures in outcome.values()
        for values in measures.values()
    )
    assert len(done.rows) == n_values
    head, *lines = to_csv(done.rows).splitlines()
    assert head == "data,protocol,condition,varied,strength,measure,method,split,person,value"
    assert len(lines) == len(done.rows)


def test_what_no_rival_can_do_is_said_once():
    found = outcome(kineme=0.9)
    found.outcomes["spotting"] = {"kineme": {UNTOUCHED: {"recall": [0.5]}}}
    said = conclusion("spotting", found)
    assert said == "No rival took part. Rivals cannot find movements in a recording."
    assert verdict(found).endswith("in any of 1 cells. No rival took part in: Spotting.")


def test_the_number_of_clusters_is_not_a_race():
    found = outcome(kineme=0.9)
    both = {"kineme": {UNTOUCHED: {"clusters": [1.0]}}, "dtw": {UNTOUCHED: {"clusters": [3.0]}}}
    found.outcomes["anchoring"] = both
    assert "Ahead of kineme" not in conclusion("anchoring", found)


def test_a_folder_that_cannot_be_written_is_found_out_first(data, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        run(data, tmp_path / "file" / "out")


def test_the_axis_of_shots_counts_whole_movements():
    outcome = {shots_label(n): {"accuracy": [0.1 * n]} for n in (1, 3, 8)}
    drawn = draw_protocol("user-independent", Results({"user-independent": {"kineme": outcome}}, {}, {}, {})).decode()
    above = drawn[: drawn.index("movements per class")]
    assert re.findall("<!-- (.*?) -->", above) == ["1", "3", "8"]
