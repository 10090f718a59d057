"""Columns of two arms, named by their sides as in data sets of LeRobot."""

from __future__ import annotations

import numpy as np
import pytest

from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channel
from kineme.robots import load
from kineme.robots.planning.roles import joints_among, space_of

pytest.importorskip("pinocchio", reason="the extra robot is not installed")


def _names(side, end=".pos"):
    return [f"{side}_{name}{end}" for name in (*load("so101").joints, "gripper")]


@pytest.mark.parametrize("before", ["", "observation.state."])
@pytest.mark.parametrize("end", [".pos", "", " [deg]"])
@pytest.mark.parametrize("side", ["left", "right"])
def test_the_columns_of_one_side_are_the_joints(side, end, before):
    names = [before + name for name in _names(side, end)]
    assert joints_among(names[::-1], load("so101")) == [5, 4, 3, 2, 1]
    channels = tuple(Channel(name, "position", (name,)) for name in names)
    assert space_of(channels, np.zeros((9, 6)), load("so101")) == "joints"


def test_of_both_sides_one_is_to_be_chosen():
    with pytest.raises(TrajectoryError, match=r"those of two, left and right; .*--columns 'left_\*'"):
        joints_among(_names("left") + _names("right"), load("so101"))


def test_joints_without_a_side_come_first_and_a_part_is_no_arm():
    names = [*load("so101").joints]
    assert joints_among([*_names("left"), *names], load("so101")) == [6, 7, 8, 9, 10]
    assert joints_among(_names("left")[1:], load("so101")) is None
    assert joints_among([f"front_{name}" for name in names], load("so101")) is None
