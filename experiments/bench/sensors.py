"""Live symbols over LSL, OSC and ROS 2 on loopback: from the push of the deciding sample to the symbol elsewhere.

`kineme listen` or `kineme ros` runs in one process, the sensor and whoever waits for symbols in another one. ROS 2 is
that of `make ros2`, or of the Python that ROS2_PYTHON names; a protocol that is not installed is left out.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import kineme
from bench.rows import Row
from kineme.movements.trajectories.trajectory import Trajectory

NAMES = ("CShape", "GShape", "NShape", "Sine", "Snake", "Spoon", "WShape", "Worm")
OF_EACH = 4  # demonstrations
RATE, REST = 100.0, 0.6  # Hz, s
LIMIT = 5.0  # ms, of the median
_CLIENT = Path(__file__).with_name("sensor_client.py")
_ROS = Path(__file__).parents[2] / ".venv-ros2/bin/python"


def measure(quick: bool) -> list[Row]:
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        folder, samples = Path(temporary) / "actions", Path(temporary) / "samples.npy"
        demos = kineme.load_lasa(NAMES)
        with kineme.ActionLibrary(folder, create=True) as library:
            library.learn(demos[[k for k in range(len(demos)) if k % 7 < OF_EACH]])
        takes = range(OF_EACH, OF_EACH + (1 if quick else 2))
        np.save(samples, np.concatenate([_between_rests(demos[7 * c + k]) for k in takes for c in range(len(NAMES))]))
        for protocol, module in (("lsl", "pylsl"), ("osc", "pythonosc"), ("ros", "rclpy")):
            python = _python_with(module, protocol == "ros")
            if python is None:
                print(f"sensors: {module} is not installed")
                continue
            taken = _latencies(protocol, python, folder, samples)
            details = {
                "symbols": len(taken),
                "rate": RATE,
                "demonstrations": OF_EACH * len(NAMES),
                "real time": os.sched_getscheduler(0) == os.SCHED_FIFO,
            }
            named = {"lsl": "LSL", "osc": "OSC", "ros": "ROS 2"}[protocol]
            rows += [
                Row(f"from a sample to its symbol, {named}, median", "ms", float(np.median(taken)),
                    target=("<=", LIMIT), details=details),
                Row(f"from a sample to its symbol, {named}, 95 of 100", "ms", float(np.quantile(taken, 0.95)),
                    details=details),
            ]  # fmt: skip
    return rows


def _between_rests(movement: Trajectory) -> np.ndarray:
    """A movement at 100 Hz, with rests around it: rows (k, 2)."""
    times = np.arange(0.0, movement.duration, 1.0 / RATE)
    rows = np.column_stack([np.interp(times, movement.times - movement.times[0], x) for x in movement.positions.T])
    still = np.ones((round(REST * RATE), 1))
    return np.concatenate((still * rows[:1], rows, still * rows[-1:]))


def _python_with(module: str, is_ros: bool) -> str | None:
    """A Python of this version that loads a module; that of ROS 2 is one of its own."""
    pythons = [os.environ.get("ROS2_PYTHON"), str(_ROS), sys.executable] if is_ros else [sys.executable]
    check = f"import sys; assert sys.version_info[:2] == {tuple(sys.version_info[:2])}; import {module}"
    for python in pythons:
        if python and (python == sys.executable or Path(python).exists()):
            done = subprocess.run([python, "-c", check], capture_output=True, env=_environment(), check=False)
            if not done.returncode:
                return python
    return None


def _environment() -> dict[str, str]:
    site = [path for path in sys.path if path and not path.endswith("bench")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(site), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def _latencies(protocol: str, python: str, folder: Path, samples: Path) -> list[float]:
    """Milliseconds of each symbol."""
    ports = [_free_port(), _free_port()]
    words = {
        "lsl": ["listen", "--from", "lsl", "--name", "bench", "--to", "lsl"],
        "osc": ["listen", "--from", "osc", "--port", str(ports[0]), "--stamped", "--to", "osc",
                "--send-to", f"127.0.0.1:{ports[1]}"],
        "ros": ["ros", "--topic", "/bench", "--columns", "0,1"],
    }[protocol]  # fmt: skip
    listening = subprocess.Popen(
        [python, "-m", "kineme", *words, "--library", str(folder)], env=_environment(), stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert listening.stderr is not None
    try:
        for line in listening.stderr:
            if line.startswith("listening"):
                break
        client = [python, str(_CLIENT), protocol, str(samples), *map(str, (*ports, listening.pid))]
        done = subprocess.run(client, env=_environment(), capture_output=True, text=True, timeout=900, check=True)
    finally:
        listening.send_signal(signal.SIGTERM)  # as Ctrl-C, which background processes ignore
        print(f"{protocol}: " + " | ".join(listening.communicate(timeout=60)[1].strip().splitlines()[-4:]))
    taken: list[float] = json.loads(done.stdout)
    return taken


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
