"""Bags of ROS in the shell: what is there, what would be read, and what is learned."""

import json
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from commands import answer, run

from bag_files import KINDS, START, Maker, pose_rows, stamps, write_bag


@pytest.fixture(params=KINDS)
def bag(request, tmp_path):
    m, rows = Maker(request.param), pose_rows()
    messages = [("/camera/info", START, m.string("x")), ("/plan", START, m.joint_trajectory("a", [0], [[1]]))]
    messages.append(("/tf_static", START, m.tf(m.transform_stamped(START, "hand", "tool", rows[0]))))
    for k, (ns, row) in enumerate(zip(stamps(), rows, strict=True)):
        messages.append(("/tf", ns, m.tf(m.transform_stamped(ns, "base", "hand", row))))
        messages.append(("/joint_states", ns, m.joint_state(ns, ["a", "b"], [np.sin(k / 9), k / 9])))
    return write_bag(tmp_path, request.param, messages, "session")


def test_inspect_lists_topics_and_frames_and_what_to_say(bag):
    done = run("inspect", bag)
    assert done.returncode == 1  # as of any file of which nothing was read
    assert run("inspect", bag, "--topic", "/joint_states").returncode == 0
    lines = [line.split() for line in done.stdout.splitlines()]
    assert ["/camera/info", "std_msgs/msg/String", "1", "nothing:", "no", "numbers"] in lines
    assert ["/joint_states", "sensor_msgs/msg/JointState", "50", "a", "movement"] in lines
    assert ["/plan", "trajectory_msgs/msg/JointTrajectory", "1", "a", "movement", "for", "each", "message"] in lines
    assert ["base", "hand", "50", "moves"] in lines
    assert ["hand", "tool", "1", "is", "fixed"] in lines
    assert "--topic /joint_states" in done.stdout
    assert "--frame parent:child" in done.stdout


def test_inspect_as_data(bag):
    done = run("inspect", bag, "--json")
    data = json.loads(done.stdout)
    assert (done.returncode, data["movements"]) == (1, 0)
    assert data["contents"]["frames"][0] == {"parent": "base", "child": "hand", "transforms": 50, "the child": "moves"}
    assert [one["topic"] for one in data["contents"]["topics"]] == sorted(
        one["topic"] for one in data["contents"]["topics"]
    )
    data = answer("inspect", bag, "--topic", "/joint_states")
    assert (data["movements"], data["dimensions"]) == (1, 2)
    assert data["detected"][0]["columns"] == ["a", "b"]


def test_inspect_lists_the_topics_of_several_bags(tmp_path):
    m = Maker("ros1")
    for name, topic in (("one", "/arm"), ("two", "/leg")):
        messages = [(topic, ns, m.joint_state(ns, ["a"], [k / 9])) for k, ns in enumerate(stamps())]
        write_bag(tmp_path, "ros1", messages, name)
    several = [f"{tmp_path}/one.bag", f"{tmp_path}/two.bag"]
    for given in ([tmp_path], several, [f"{tmp_path}/*.bag"]):
        topics = answer("inspect", *given)["contents"]["topics"]
        folder = "" if given == [tmp_path] else f"{tmp_path}/"
        assert [(one["file"], one["topic"]) for one in topics] == [
            (f"{folder}one.bag", "/arm"),
            (f"{folder}two.bag", "/leg"),
        ]
    assert "file" not in answer("inspect", several[0])["contents"]["topics"][0]


def test_inspect_says_once_what_several_bags_have_alike_and_leaves_out_what_does_not_move(tmp_path):
    m = Maker("ros1")
    for n in (20, 30):
        messages = [("/arm", ns, m.joint_state(ns, ["a"], [k / 9])) for k, ns in enumerate(stamps(n))]
        messages += [(f"/idle_{k}", START, m.string("x")) for k in range(25)]
        write_bag(tmp_path, "ros1", messages, f"of_{n}")
    done = run("inspect", tmp_path)
    lines = [line.split() for line in done.stdout.splitlines()]
    assert ["/arm", "sensor_msgs/msg/JointState", "20", "to", "30", "a", "movement", "2", "of", "2"] in lines
    assert "and 25 topics that hold no movement; --json lists them" in done.stdout
    assert len(lines) < 20
    assert len(answer("inspect", tmp_path)["contents"]["topics"]) == 52


def test_what_is_read_is_said(bag):
    done = run("inspect", bag, "--frame", "base:tool")
    assert "frames base:tool: time 'header.stamp' in s (stamps of headers)" in done.stdout


def test_topics_and_frames_are_learned(bag, tmp_path):
    library = tmp_path / "library"
    one = answer("learn", bag, "--topic", "/joint_states", "--label", "wave", "--library", library)
    assert (one["added"], one["symbols"], one["problems"]) == (1, ["wave"], [])
    assert answer("learn", bag, "--topic", "/joint_states", "--label", "wave", "--library", library)["duplicates"] == 1
    with closing(sqlite3.connect(library / "library.sqlite")) as opened:
        (path, sha256, options), *others = opened.execute("SELECT path, sha256, options FROM source").fetchall()
    assert path == str(bag)
    assert len(sha256) == 64
    assert "/joint_states" in options
    assert not others


def test_options_that_are_not_given_are_not_stored(tmp_path):
    """A source is known by its bytes and options: new options of the shell must not make old sources new."""
    (tmp_path / "a.csv").write_text("t,x\n" + "".join(f"{k},{k * k}\n" for k in range(5)))
    answer("learn", tmp_path / "a.csv", "--label", "wave", "--library", tmp_path / "library")
    with closing(sqlite3.connect(tmp_path / "library" / "library.sqlite")) as opened:
        ((options,),) = opened.execute("SELECT options FROM source").fetchall()
    assert "topic" not in options
    assert "frame" not in options


def test_a_damaged_bag_fails_with_its_name(tmp_path):
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n")
    done = run("inspect", tmp_path / "a.mcap")
    assert done.returncode == 1
    assert "a.mcap: expected a bag of ROS that can be opened" in done.stderr
