"""The commands ``kineme listen`` and ``kineme ros``: what they refuse, and a process that listens until Ctrl-C."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import socket
import subprocess
import sys
import time

import pytest
from click.testing import CliRunner
from sensor_samples import make_library, take

import kineme
from kineme.cli import main
from soaking import slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("commands") / "actions"
    make_library(folder).close()
    return folder


def _run(*words):
    return CliRunner().invoke(main, [*map(str, words)], prog_name="kineme")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("listen", "--from", "osc", "--name", "hand"), "expected --from or --to with the protocol of --name"),
        (("listen", "--from", "osc", "--send-to", "127.0.0.1:9001"), "with the protocol of --send-to"),
        (("listen", "--from", "lsl", "--send-to", "nowhere"), "expected a host and a port, as 127.0.0.1:9001"),
        (("listen", "--from", "lsl", "--rest", "0"), "--rest"),
        (("listen", "--from", "midi"), "midi"),
        (("ros",), "expected one of --topic and --frame"),
        (("ros", "--topic", "/a", "--frame", "a:b"), "expected one of --topic and --frame"),
        (("ros", "--topic", "/a", "--execute"), "expected --execute and --robot, or neither"),
        (("ros", "--topic", "/a", "--robot", "panda"), "expected --execute and --robot, or neither"),
    ],
)
def test_options_that_do_not_go_together_are_refused(folder, words, said):
    done = _run(*words, "--library", folder)
    assert done.exit_code == 2
    assert said in done.output


@pytest.mark.skipif(importlib.util.find_spec("rclpy") is not None, reason="ROS 2 is here")
def test_without_ros_2_it_says_what_is_missing(folder):
    done = _run("ros", "--topic", "/tip", "--library", folder)
    assert done.exit_code == 1
    assert "expected the package rclpy of ROS 2" in done.output


def test_without_a_package_it_says_which_extra_has_it(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "pythonosc", None)
    done = _run("listen", "--from", "osc", "--library", folder)
    assert done.exit_code == 1
    assert "pip install 'kineme[osc]'" in done.output


def _free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.mark.parametrize("how", [signal.SIGINT, slow(signal.SIGTERM)])
def test_a_process_names_what_is_sent_to_it_and_ends_cleanly(folder, how):
    udp_client = pytest.importorskip("pythonosc.udp_client", reason="no python-osc; pip install python-osc")
    port = _free_port()
    command = [sys.executable, "-W", "error", "-m", "kineme", "listen", "--from", "osc", "--stamped", "--json"]
    listening = subprocess.Popen(
        [*command, "--port", str(port), "--library", str(folder)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )  # fmt: skip
    try:
        assert listening.stderr.readline() == "listening; stop it with Ctrl-C\n"
        client = udp_client.SimpleUDPClient("127.0.0.1", port)
        for k, row in enumerate(take("Sine").tolist()):
            client.send_message("/hand", [k / 100, *row])
            if k % 20 == 0:
                time.sleep(0.02)  # so that the other process reads what was sent
        client._sock.close()
        symbols = []
        while not symbols or not symbols[-1]["is_over"]:
            symbols.append(json.loads(listening.stdout.readline()))
    finally:
        listening.send_signal(how)
        _, said = listening.communicate(timeout=60)
    assert symbols[-1]["name"] == "Sine"
    assert listening.returncode == 0
    assert "1 movement: Sine 1\nfrom a sample to its symbol: " in said
    assert "Traceback" not in said


def test_a_library_without_symbols_is_refused(tmp_path):
    kineme.ActionLibrary(tmp_path / "empty", create=True).close()
    done = _run("listen", "--from", "osc", "--library", tmp_path / "empty")
    assert done.exit_code == 1
    assert done.output.startswith("kineme: expected")
