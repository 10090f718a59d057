"""A session of poses as a bag of several topics: gestures learned from labels are named in another session."""

import numpy as np
import pytest
from commands import answer, run

from bag_files import KINDS, SECOND, START, Maker, write_bag
from kineme.orientation import conjugate, product
from rotation_samples import carry
from soaking import some

RATE = 100.0
GESTURES = {"lift": 1, "pour": 2, "wave": 3}


def session(names, seed):
    """Poses (x, y, z, qx, qy, qz, qw) of gestures with rests between, and (start, end, name) of each [s]."""
    rng = np.random.default_rng(seed)
    x, q = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    parts, told, n = [], [], 0
    for name in names:
        pose = carry(GESTURES[name], int(rng.integers(90, 130)))
        way = x + rng.uniform(0.9, 1.1) * (pose[:, :3] - pose[0, :3])
        turned = product(product(pose[:, 3:], conjugate(pose[:1, 3:])), q)
        x, q = way[-1], turned[-1]
        path = np.column_stack([way, turned])
        parts += [path, np.repeat(path[-1:], 60, axis=0)]
        told.append((n / RATE, (n + len(path)) / RATE, name))
        n += len(path) + 60
    rows = np.concatenate(parts)[:, [0, 1, 2, 4, 5, 6, 3]]
    return rows + np.column_stack([rng.normal(0, 1e-4, (n, 3)), np.zeros((n, 4))]), told


def bag_of(folder, kind, rows, name, topics=("/tool", "/joint_states", "/cmd")):
    m, messages = Maker(kind), []
    for k, row in enumerate(rows):
        ns = START + round(k * SECOND / RATE)
        several = {
            "/tool": lambda: m.pose_stamped(ns, row),  # noqa: B023
            "/camera": lambda: m.pose_stamped(ns, row[[1, 0, 2, 3, 4, 5, 6]]),  # noqa: B023
            "/joint_states": lambda: m.joint_state(ns, list("abcdefg"), list(np.sin(k / 30 + np.arange(7)))),  # noqa: B023
            "/cmd": lambda: m.twist([np.cos(k / 9)] * 6),  # noqa: B023
        }
        messages += [(topic, ns, several[topic]()) for topic in topics]
    return write_bag(folder, kind, messages, name)


def learned(folder, kind, *options, **how):
    """A library of four of each gesture, cut from one session by a table of labels."""
    rows, told = session([*GESTURES] * 4, 7)
    begin = START / SECOND
    lines = [f"{begin + start},{begin + end},{name}" for start, end, name in told]
    (folder / "told.csv").write_text("\n".join(["start,end,label", *lines]))
    bag = bag_of(folder, kind, rows, "shown", **how)
    said = answer("learn", bag, "--labels", folder / "told.csv", *options, "-l", folder / "actions")
    assert sorted(said["symbols"]) == sorted(GESTURES)
    return folder / "actions"


NAMES = ["pour", "lift", "wave", "wave", "pour", "lift"]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return learned(tmp_path_factory.mktemp("gestures"), "mcap", "--topic", "/tool")


def named(said, told):
    begin = START / SECOND
    assert [
        [one["symbol"] for one in said["annotations"] if one["start"] <= begin + 0.5 * (a + b) <= one["end"]]
        for a, b, _ in told
    ] == [[name] for *_, name in told]


@pytest.mark.parametrize("kind", some(KINDS, 0))
def test_every_gesture_of_a_session_is_named_and_the_topic_is_that_of_the_library(library, kind, tmp_path):
    rows, told = session(NAMES, 8)
    bag = bag_of(tmp_path, kind, rows, "session", ("/joint_states", "/camera", "/tool"))
    out = tmp_path / ("named.bag" if kind == "ros1" else "named")
    said = answer("annotate", bag, "-l", library, "-o", out)
    named(said, told)
    assert said["notes"] == [
        "Read topic /tool of geometry_msgs/msg/PoseStamped, as the movements of the library; say --topic or --frame "
        "for others"
    ]
    inspected = answer("inspect", out, "--topic", "/tool")
    assert "/kineme/annotations" in {one["topic"] for one in inspected["contents"]["topics"]}
    assert answer("annotate", bag, "-l", library, "--topic", "/tool")["notes"] == []
    assert "Read topic /tool" in run("annotate", bag, "-l", library).stdout


def test_without_a_topic_in_the_library_the_only_one_with_its_columns_is_taken(tmp_path):
    library = learned(tmp_path, "mcap", topics=("/tool",))
    rows, _ = session(NAMES, 8)
    bag = bag_of(tmp_path, "mcap", rows, "session", ("/joint_states", "/cmd", "/camera"))
    said = answer("annotate", bag, "-l", library)
    assert said["notes"][0].startswith("Read topic /camera of ")
    both = bag_of(tmp_path, "mcap", rows, "both", ("/camera", "/tool"))
    asked = run("annotate", both, "-l", library)
    assert asked.returncode == 1
    assert "say which with topic=" in asked.stderr


def test_recognize_takes_the_topic_of_the_library_too(library, tmp_path):
    rows, ((start, end, name),) = session(["pour"], 9)
    bag = bag_of(tmp_path, "mcap", rows[round(start * RATE) : round(end * RATE)], "one")
    said = answer("recognize", bag, "-l", library)
    assert [movement["answer"]["ranked"][0]["label"] for movement in said["movements"]] == [name]
    assert said["notes"][0].startswith("Read topic /tool of ")
