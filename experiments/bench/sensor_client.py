"""The other side of `bench.sensors`: sends the samples of a file at 100 Hz, and prints when each symbol arrived.

It runs in the Python of the protocol, which need not have kineme: ``sensor_client.py lsl samples.npy port port pid``.
"""

from __future__ import annotations

import json
import math
import os
import socket
import sys
import threading
import time
from collections.abc import Callable

import numpy as np

RATE = 100.0  # Hz
_LAST = 2.0  # seconds that the last symbols may take
Push = Callable[[list[float], int], float]
Heard = Callable[[float, float], None]  # the stamp that a symbol names, and when it arrived


def lsl(numbers: list[int], heard: Heard) -> Push:
    import pylsl

    pylsl.set_config_content("[log]\nlevel = -3\n[multicast]\nResolveScope = machine\nListenAddress = 127.0.0.1\n")
    outlet = pylsl.StreamOutlet(pylsl.StreamInfo("bench", "MoCap", 2, RATE, pylsl.cf_double64, "bench"))
    markers = pylsl.StreamInlet(pylsl.resolve_bypred(f"source_id='kineme-{numbers[2]}'", timeout=60)[0])
    markers.open_stream(timeout=60)
    outlet.wait_for_consumers(60)
    time.sleep(2.0)  # clocks are compared

    def read() -> None:
        while True:
            sample, _ = markers.pull_sample()
            arrived = time.monotonic()
            _record(sample[0], arrived, heard)

    def push(row: list[float], k: int) -> float:
        stamp = pylsl.local_clock()
        outlet.push_sample(row, stamp)
        return stamp

    threading.Thread(target=read, daemon=True).start()
    return push


def _record(text: str, arrived: float, heard: Heard) -> None:
    heard(json.loads(text)["time"], arrived)


def osc(ports: list[int], heard: Heard) -> Push:
    from pythonosc.osc_packet import OscPacket
    from pythonosc.udp_client import SimpleUDPClient

    client, receiver = SimpleUDPClient("127.0.0.1", ports[0]), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.bind(("127.0.0.1", ports[1]))

    def read() -> None:
        while True:
            datagram = receiver.recv(65_536)
            arrived = time.monotonic()
            for _, message in OscPacket(datagram).messages:
                heard(list(message)[-1], arrived)

    def push(row: list[float], k: int) -> float:
        client.send_message("/hand", [k / RATE, *row])
        return k / RATE

    threading.Thread(target=read, daemon=True).start()
    return push


def ros(_: list[int], heard: Heard) -> Push:
    import rclpy
    from geometry_msgs.msg import PointStamped
    from std_msgs.msg import String

    rclpy.init()
    node = rclpy.create_node("bench")
    publisher = node.create_publisher(PointStamped, "/bench", 10)
    node.create_subscription(String, "/kineme/symbol", lambda m: _record(m.data, time.monotonic(), heard), 10)
    while not publisher.get_subscription_count():
        time.sleep(0.1)

    def push(row: list[float], k: int) -> float:
        message = PointStamped()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(10_000_000 * (k + 1), 1_000_000_000)
        message.point.x, message.point.y = row
        publisher.publish(message)
        return (k + 1) / RATE

    threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
    return push


def main() -> None:
    """Send, wait for the last symbols, and print milliseconds from each deciding sample to its symbol."""
    rows = np.load(sys.argv[2]).tolist()
    arrivals: list[tuple[float, float]] = []
    push = {"lsl": lsl, "osc": osc, "ros": ros}[sys.argv[1]](
        [int(port) for port in sys.argv[3:]], lambda stamp, arrived: arrivals.append((stamp, arrived))
    )
    stamps, pushed, began = [], [], time.monotonic()
    for k, row in enumerate(rows):
        time.sleep(max(began + k / RATE - time.monotonic(), 0.0))
        pushed.append(time.monotonic())
        stamps.append(push(row, k))
    time.sleep(_LAST)
    taken = [1e3 * (arrived - pushed[int(np.abs(np.array(stamps) - stamp).argmin())]) for stamp, arrived in arrivals]
    print(json.dumps([value for value in taken if math.isfinite(value)]), flush=True)


if __name__ == "__main__":
    main()
    os._exit(0)  # threads wait in foreign code
