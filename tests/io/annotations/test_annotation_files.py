"""Files of annotations, read back by pandas and as the makers of other programs describe them."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import pandas
import pytest

from kineme.errors import DataError
from kineme.io.writing.annotations import WRITERS, Annotation, Writer, write_annotations, writer_of

LONG = Path("long.csv")
WAVE = Annotation("long.csv", "", 1000.5, 1001.75, 'wave, "big"\nü', 0.4, 0.93, 1000.0, 0.125)
UNKNOWN = Annotation("long.csv", "", 1002.0, 1004.0, None, 0.01, 0.99, origin=1000.0)


def test_pandas_reads_the_table(tmp_path):
    (path,) = write_annotations(tmp_path / "what.csv", [WAVE, UNKNOWN], [LONG])
    table = pandas.read_csv(path)
    heads = ["recording", "place", "start", "end", "symbol", "p_value", "confidence", "unknown", "uncertainty"]
    assert [*table] == heads
    assert table["start"].tolist() == [1000.5, 1002.0]
    assert table["end"].tolist() == [1001.75, 1004.0]
    assert table["symbol"].tolist()[0] == WAVE.symbol
    assert table["symbol"].isna().tolist() == [False, True]
    assert table["unknown"].tolist() == [False, True]
    assert table["p_value"].tolist() == [0.4, 0.01]
    assert table["uncertainty"].tolist() == pytest.approx([0.125, float("nan")], nan_ok=True)


def test_json_has_the_same(tmp_path):
    (path,) = write_annotations(tmp_path / "what.JSON", [WAVE, UNKNOWN], [LONG])
    first, second = json.loads(path.read_text(encoding="utf-8"))
    assert first["symbol"] == WAVE.symbol
    assert second["symbol"] is None
    assert second["unknown"] is True
    assert (first["uncertainty"], second["uncertainty"]) == (0.125, None)
    assert len(pandas.read_json(path)) == 2


def test_audacity_labels_are_starts_ends_and_texts_since_the_first_sample(tmp_path):
    (path,) = write_annotations(tmp_path / "labels.txt", [WAVE, UNKNOWN], [LONG])
    rows = [line.split("\t") for line in path.read_text(encoding="utf-8").splitlines()]
    assert [(float(a), float(b), text) for a, b, text in rows] == [(0.5, 1.75, 'wave, "big" ü'), (2, 4, "unknown")]


def test_elan_has_the_structure_of_its_schema(tmp_path):
    (path,) = write_annotations(tmp_path / "what.eaf", [WAVE, UNKNOWN], [LONG])
    root = ElementTree.parse(path).getroot()
    assert root.tag == "ANNOTATION_DOCUMENT"
    assert {"AUTHOR", "DATE", "VERSION", "FORMAT"} <= set(root.attrib)
    order = ["HEADER", "TIME_ORDER", "TIER", "LINGUISTIC_TYPE", "CONSTRAINT"]  # the sequence of the schema
    tags = [element.tag for element in root]
    assert tags == sorted(tags, key=order.index)
    assert set(tags) == set(order)
    times = {element.get("TIME_SLOT_ID"): int(element.get("TIME_VALUE")) for element in root.iter("TIME_SLOT")}
    types = {element.get("LINGUISTIC_TYPE_ID"): element for element in root.iter("LINGUISTIC_TYPE")}
    tiers = {element.get("TIER_ID"): element for element in root.iter("TIER")}
    assert all(tier.get("LINGUISTIC_TYPE_REF") in types for tier in tiers.values())
    ids = [element.get("ANNOTATION_ID") for element in root.iter() if element.get("ANNOTATION_ID")]
    assert len(set(ids)) == len(ids) == 6
    spans = [
        (
            times[element.get("TIME_SLOT_REF1")],
            times[element.get("TIME_SLOT_REF2")],
            element.findtext("ANNOTATION_VALUE"),
        )
        for element in tiers["symbol"].iter("ALIGNABLE_ANNOTATION")
    ]
    assert [span[:2] for span in spans] == [(500, 1750), (2000, 4000)]
    assert spans[1][2] == "unknown"
    p_values = [*tiers["p-value"].iter("REF_ANNOTATION")]
    assert [element.findtext("ANNOTATION_VALUE") for element in p_values] == ["0.4", "0.01"]
    assert [element.get("ANNOTATION_REF") for element in p_values] == ["a1", "a2"]
    assert tiers["p-value"].get("PARENT_REF") == "symbol"
    constraint = types[tiers["p-value"].get("LINGUISTIC_TYPE_REF")].get("CONSTRAINTS")
    assert constraint == root.find("CONSTRAINT").get("STEREOTYPE") == "Symbolic_Association"


def test_a_control_character_in_a_symbol_leaves_the_document_readable(tmp_path):
    odd = Annotation("long.csv", "", 1.0, 1.0, "a\x00\x1b<&", 0.4, 0.93)
    (path,) = write_annotations(tmp_path / "what.eaf", [odd], [LONG])
    assert ElementTree.parse(path).findtext(".//ANNOTATION_VALUE") == "a\\x00\\x1b<&"
    assert [element.get("TIME_VALUE") for element in ElementTree.parse(path).iter("TIME_SLOT")] == ["1000", "1001"]


def test_several_movements_become_a_file_each_in_a_folder(tmp_path):
    several = [Annotation(*where, 0.0, 1.0, "wave", 0.5, 0.9) for where in (("a/b.mcap", "1"), ("a/B.mcap", "1"))]
    written = write_annotations(tmp_path / "named", several, [LONG], "audacity")
    assert [path.name for path in written] == ["a-b-1.txt", "a-B-1-2.txt"]
    with pytest.raises(DataError, match="name a folder"):
        write_annotations(tmp_path / "what.eaf", several, [LONG])


def test_what_no_writer_knows_is_refused_with_the_list():
    with pytest.raises(DataError, match=r"one of \.csv, \.json, \.eaf, \.txt.*got 'what.doc'.*csv, json"):
        writer_of(Path("what.doc"), None, [LONG])
    with pytest.raises(DataError, match="only one data set of LeRobot, or one bag in a folder, is copied"):
        writer_of(Path("named"), None, [LONG])


def test_a_writer_of_copies_is_chosen_by_its_recording(monkeypatch):
    copy = Writer(lambda path, annotations, source: path, (".mcap",), copies=lambda source: source.suffix == ".mcap")
    monkeypatch.setitem(WRITERS, "bag", copy)
    assert writer_of(Path("named"), None, [Path("a.mcap")]) is copy
    assert writer_of(Path("named.mcap"), None, [Path("a.mcap")]) is copy
    for sources in ([LONG], [Path("a.mcap")] * 2):
        with pytest.raises(DataError, match=r"can be copied|expected a path ending"):
            writer_of(Path("named.mcap"), None, sources)
