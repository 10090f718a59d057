"""The studio over loopback: from samples sent to the state of the movement, one client alone and fifty at once."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import kineme
from bench.movements import SEED
from bench.rows import Row
from kineme.movements.preparation.perturbations import Perturbation

SYMBOLS, OF_EACH, CLIENTS = 100, 2, 50
RATE, IN_MESSAGE = 120.0, 2  # samples per second of a pen, and how many come at once: a message with every picture
MEDIAN, P99 = 10.0, 30.0  # ms
_TOKEN = "the-token-of-the-benchmark"
_PERTURBATION = Perturbation(shift=1.0, scale=0.3, rotation=np.radians(10), warp=0.2, noise=0.01)
_SHEAR = 0.5  # between the symbols that are made of one movement


def measure(quick: bool) -> list[Row]:
    try:
        import fastapi  # noqa: F401
        import websockets  # noqa: F401
    except ImportError:
        print("studio: the extra studio is not installed")
        return []
    symbols, clients = (20, 5) if quick else (SYMBOLS, CLIENTS)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "actions"
        drawn = _filled(folder, symbols)
        with _running(folder) as address:
            asyncio.run(_draw(address, drawn[0]))  # code is loaded
            alone = [one for movement in drawn[1:6] for one in asyncio.run(_draw(address, movement))]
            crowd = asyncio.run(_draw_together(address, drawn, clients))
    details = {"rate": RATE, "samples in a message": IN_MESSAGE, "seed": SEED, "perturbation": repr(_PERTURBATION)}
    named = f"{symbols} symbols of {OF_EACH} movements"
    rows = []
    for took, words, targets in ((alone, "", (MEDIAN, P99)), (crowd, f", {clients} clients at once", (None, None))):
        for share, what, bound in ((50, "median", targets[0]), (99, "99th percentile", targets[1])):
            target = None if bound is None or quick else ("<=", bound)
            value = float(np.percentile(took, share))
            rows.append(Row(f"samples to state, {named}{words}, {what}", "ms", value, target=target, details=details))
    return rows


def _filled(folder: Path, symbols: int) -> kineme.Demonstrations:
    """A library of so many symbols, LASA's and sheared ones, and one drawing of each, by another hand."""
    lasa = kineme.load_lasa()
    kinds = sorted(set(lasa.labels.tolist()))
    first = {kind: int(np.flatnonzero(lasa.labels == kind)[0]) for kind in kinds}
    movements, labels = [], []
    for k in range(symbols):
        one = lasa[first[kinds[k % len(kinds)]]]
        shear = np.array([[1.0, _SHEAR * (k // len(kinds))], [0.0, 1.0]])
        movements.append(kineme.Trajectory(one.times[::5], one.positions[::5] @ shear.T))
        labels.append(f"{kinds[k % len(kinds)]} {k // len(kinds)}")
    shown = kineme.Demonstrations(movements)
    with kineme.ActionLibrary(folder, create=True) as library:
        for seed in range(OF_EACH):
            library.learn(_PERTURBATION.apply(shown, SEED + seed), labels)
    return _PERTURBATION.apply(shown, SEED + OF_EACH)


@contextmanager
def _running(folder: Path) -> Iterator[str]:
    """The studio as the command starts it; the address of its websocket."""
    command = [sys.executable, "-m", "kineme", "studio", "-l", str(folder), "--no-open"]
    environment = os.environ | {"KINEME_STUDIO_TOKEN": _TOKEN}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        yield line[line.index("http") :].partition("/?")[0].replace("http", "ws", 1) + "/api/live"
    finally:
        process.terminate()
        process.wait()
        process.stdout.close()


async def _draw(address: str, movement: kineme.Trajectory, late: float = 0.0) -> list[float]:
    """Send a movement as fast as it is drawn: milliseconds from each message to the state that answers it."""
    from websockets.asyncio.client import connect

    times = np.arange(movement.times[0], movement.times[-1], 1 / RATE)
    rows = np.column_stack([times, *(np.interp(times, movement.times, x) for x in movement.positions.T)]).tolist()
    await asyncio.sleep(late)
    took = []
    async with connect(address, additional_headers={"Authorization": f"Bearer {_TOKEN}"}) as socket:
        begin = time.perf_counter()
        for start in range(0, len(rows), IN_MESSAGE):
            due = begin + start / RATE
            await asyncio.sleep(max(0.0, due - time.perf_counter()))
            sent = time.perf_counter()
            await socket.send(json.dumps({"samples": rows[start : start + IN_MESSAGE]}))
            answer: dict[str, Any] = {}
            while "state" not in answer:
                answer = json.loads(await socket.recv())
                assert "error" not in answer, answer
            took.append(1e3 * (time.perf_counter() - sent))
        await socket.send(json.dumps({"finish": True}))
        assert "answer" in json.loads(await socket.recv())
    return took


async def _draw_together(address: str, drawn: kineme.Demonstrations, clients: int) -> list[float]:
    """So many clients that begin within one second."""
    tasks = [_draw(address, drawn[k % len(drawn)], k / clients) for k in range(clients)]
    return [one for took in await asyncio.gather(*tasks) for one in took]
