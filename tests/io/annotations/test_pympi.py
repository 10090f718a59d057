"""Documents of ELAN, exchanged with pympi, which linguists read and write them with."""

from pathlib import Path

import pytest

from kineme.io.reading.read_labels import read_labels
from kineme.io.writing.annotations import Annotation, write_annotations

elan = pytest.importorskip("pympi.Elan", reason="no package pympi-ling")

WAVE = Annotation("long.csv", "", 1000.5, 1001.75, 'wave, "big" ü', 0.4, 0.93, origin=1000.0)
UNKNOWN = Annotation("long.csv", "", 1002.0, 1004.0, None, 0.01, 0.99, origin=1000.0)


def test_pympi_reads_what_was_annotated(tmp_path):
    (path,) = write_annotations(tmp_path / "what.eaf", [WAVE, UNKNOWN], [Path("long.csv")])
    read = elan.Eaf(str(path))
    assert read.get_annotation_data_for_tier("symbol") == [(500, 1750, WAVE.symbol), (2000, 4000, "unknown")]
    assert set(read.get_child_tiers_for("symbol")) == {"p-value", "confidence"}
    below = read.get_ref_annotation_data_for_tier("p-value")
    assert [(start, end, text) for start, end, text, _ in below] == [(500, 1750, "0.4"), (2000, 4000, "0.01")]
    read.to_file(str(tmp_path / "again.eaf"))
    again = [(row.start, row.end, row.label) for row in read_labels(tmp_path / "again.eaf").rows]
    assert again == [(row.start, row.end, row.label) for row in read_labels(path).rows]


def test_what_a_person_annotated_is_read(tmp_path):
    document = elan.Eaf(author="anna")
    document.remove_tier("default")
    document.add_tier("gesture")
    for start, end, label in ((500, 1750, "wave"), (2000, 4000, "point at <x> & y")):
        document.add_annotation("gesture", start, end, label)
    document.to_file(str(tmp_path / "by_hand.eaf"))
    table = read_labels(tmp_path / "by_hand.eaf")
    spans = [(row.start, row.end, row.label) for row in table.rows]
    assert spans == [(0.5, 1.75, "wave"), (2.0, 4.0, "point at <x> & y")]
    assert table.since_start is True
