"""What docs/beside-others.md and docs/migrating say of others is what was measured."""

import json
import pkgutil
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from walk_through import walk

import kineme
from kineme.cli import main as commands
from result_tables import beside as beside_tables
from result_tables import features as feature_table
from result_tables.measured import SHOWN, filled

ROOT = Path(__file__).parents[1]

MIGRATED = json.loads((ROOT / "experiments" / "results" / "migrating.json").read_text(encoding="utf-8"))["rows"]


@pytest.mark.parametrize("page", beside_tables.tables())
def test_the_pages_show_what_was_measured(page):
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    assert text == filled(text, beside_tables.tables()[page]), "run make tables"


VERSIONS, FEATURES = feature_table.features()


@pytest.mark.parametrize("feature", FEATURES)
def test_public_names_give_each_feature_that_we_claim(feature):
    answer, *names = FEATURES[feature]["kineme"]
    assert bool(names) == (answer != "no")
    for name in names:
        first, _, command = name.partition(" ")
        if command:
            assert command in commands.commands
        else:
            chapter = first.split(".")[1]
            if chapter == "torch":  # in the package, and not among the names that need no other
                pytest.importorskip("torch", reason="the extra torch is not installed")
            else:
                assert chapter in kineme.__all__
            pkgutil.resolve_name(name)


def test_features_are_said_of_libraries_whose_version_is_named():
    assert {library for cells in FEATURES.values() for library in cells} == {"kineme", *VERSIONS}
    assert "| rhythmic DMPs | yes | no | no | yes |" in feature_table.table()
    assert "\n- **pydmps 0.2.** discrete DMPs: `pydmps.dmp_discrete.DMPs_discrete`; " in feature_table.sources()


@pytest.mark.parametrize("library", VERSIONS)
def test_the_others_have_the_names_that_are_given(library):
    names = [name for cells in FEATURES.values() for name in cells.get(library, [""])[1:]]
    pytest.importorskip(
        names[0].partition(".")[0], reason=f"{library} is not installed; make bench and make evaluate do"
    )
    assert metadata.version(library) == VERSIONS[library], "look at its features again: docs/features.toml"
    for name in names:
        pkgutil.resolve_name(name)


def test_what_is_left_out_is_nowhere_ahead_of_what_is_shown():
    """$P, of which the pages say that $P+ is ahead of it or level with it in every row."""
    assert "point-cloud" not in SHOWN
    for _, found, asked in beside_tables.evaluated().values():
        for _, protocol, condition, measure in asked:
            by_method = found[protocol]
            if "point-cloud" in by_method:
                left_out, shown = (by_method[one][condition][measure]["mean"] for one in ("point-cloud", "plus-cloud"))
                assert round(shown, 3) >= round(left_out, 3)


def _protocol(**means):
    return {"one": {name: {"as recorded": {"accuracy": {"mean": mean}}} for name, mean in means.items()}}


@pytest.mark.parametrize(
    ("ours", "theirs", "said"),
    [
        (0.91, 0.9, "ahead of all others in all 1 rows."),
        (0.9004, 0.9, "ahead of all others in 0 of these 1 rows and level with the best in 1."),
        (0.89, 0.9, "in 0 of these 1 rows. Ahead of it: DTW 1-NN in *row* (0.900 against 0.890)."),
    ],
)
def test_it_is_said_who_is_ahead(ours, theirs, said):
    protocols = _protocol(kineme=ours, dtw=theirs, euclidean=0.5)
    assert beside_tables.who_leads(protocols, [("row", "one", "as recorded", "accuracy")]).endswith(said)


@pytest.mark.parametrize("row", MIGRATED, ids=lambda row: row["details"]["page"])
def test_ours_gives_the_result_that_the_peer_gave(row, tmp_path):
    """The peer's code on the page was run where it is installed: ``python -m bench --only migrating``."""
    page = row["details"]["page"]
    if page == "mp_pytorch":
        pytest.importorskip("torch", reason="the extra torch is not installed")
    names = {}
    list(walk(ROOT / "docs" / "migrating" / f"{page}.md", tmp_path, names))
    theirs = row["details"]["theirs"]
    if page == "dollar":
        assert list(map(str, names["ours"])) == theirs
        return
    at, positions = np.array(theirs)[:, 0].astype(int), np.array(theirs)[:, 1:]
    apart = np.linalg.norm(names["ours"][at] - positions, axis=1).max()
    assert 100 * apart / np.ptp(names["ours"], axis=0).max() <= row["ours"] + 0.01


@pytest.mark.parametrize("row", MIGRATED, ids=lambda row: row["details"]["page"])
def test_the_peer_measured_again(row):
    from bench.migrating import COMPARED, executed

    page = row["details"]["page"]
    module, compare, *_ = COMPARED[page]
    pytest.importorskip(module, reason=f"{module} is not installed; make bench installs and compares it")
    assert compare(executed(page))[0] == pytest.approx(row["ours"], abs=0.01)
