"""A data set in Lance with a link where names are written in place."""

import pytest

from kineme.io.lerobot.motions import PENDING, Motion, read_motions
from lerobot_sets import write_lance


def test_a_link_leads_no_writer_out_of_the_data_set(tmp_path):
    pytest.importorskip("lance", reason="Lance holds the frames")
    from kineme.io.lerobot.copy import name_in_place

    folder, outside = write_lance(tmp_path / "set"), tmp_path / "outside.txt"
    outside.write_text("a secret")
    link = folder / f"{PENDING}.new"
    link.parent.mkdir()
    link.symlink_to(outside)
    name_in_place(folder, {0: [Motion(0, 0.0, 0.3, "nod")]})
    assert outside.read_text() == "a secret"
    assert [motion.symbol for motion in read_motions(folder)] == ["nod"]
