"""Calls in another process, under a limit of memory and of time: what kills that process is seen and survived.

The process serves many calls, one after the other, and is started anew only after it died or hung.
"""

from __future__ import annotations

import importlib
import os
import pickle
import resource
import select
import struct
import subprocess
import sys
import traceback
from pathlib import Path
from typing import NamedTuple

MIB = 2**20
_LENGTH = struct.Struct("<Q")


class Outcome(NamedTuple):
    """What became of a call.

    `how` is "done" with the value; "refused" with the message of a `KinemeError`; "raised" with the traceback of any
    other exception, `MemoryError` too; "died" with the signal or exit code; "hung" with the seconds.
    """

    how: str
    what: object

    @property
    def is_good(self):
        return self.how in ("done", "refused")


class LimitedChild:
    """A process that calls functions of modules on this process's path.

    Parameters
    ----------
    modules : sequence of str
        Imported before the limit is set, so that it is of what the calls take and not of what the libraries do.
    memory : int
        Bytes of address space beyond that. Systems without `RLIMIT_AS` have no limit.
    seconds : float
        Per call.
    """

    def __init__(self, modules=("kineme",), memory=1024 * MIB, seconds=20.0):
        self.modules, self.memory, self.seconds = tuple(modules), memory, seconds
        self._process = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._end()

    def call(self, function, *arguments):
        """Call ``function`` ("module:name") with arguments that pickle takes."""
        if self._process is None:
            self._start()
        try:
            _send(self._process.stdin, (function, arguments))
            answer = self._receive()
        except (BrokenPipeError, EOFError):
            answer = None
        if answer is None:
            code = self._end()
            return Outcome("died", f"exit code {code}")
        if answer == "hung":
            self._process.kill()
            self._end()
            return Outcome("hung", f"no answer within {self.seconds} s")
        return Outcome(*answer)

    def _start(self):
        environment = os.environ | {
            "PYTHONPATH": os.pathsep.join(one for one in sys.path if one),
            "OMP_NUM_THREADS": "1",
        }
        command = [sys.executable, __file__, str(self.memory), *self.modules]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
        )
        assert self._process.stdout.read(1) == b"!", f"the child could not import {self.modules}"

    def _receive(self):
        ready, _, _ = select.select([self._process.stdout], [], [], self.seconds)
        return pickle.loads(_read(self._process.stdout)) if ready else "hung"

    def _end(self):
        process, self._process = self._process, None
        if process is None:
            return None
        process.stdin.close()
        try:
            return process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait()
        finally:
            process.stdout.close()


def _send(stream, message):
    data = pickle.dumps(message)
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def _read(stream):
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError
    return stream.read(_LENGTH.unpack(head)[0])


def _limit_memory(beyond):
    status = Path("/proc/self/status")
    if status.exists():
        used = next(
            int(line.split()[1]) * 1024 for line in status.read_text().splitlines() if line.startswith("VmSize")
        )
        resource.setrlimit(resource.RLIMIT_AS, (used + beyond, used + beyond))


def _answer(call):
    from kineme.errors import KinemeError

    (module, _, name), arguments = call[0].partition(":"), call[1]
    try:
        return "done", getattr(importlib.import_module(module), name)(*arguments)
    except KinemeError as error:
        return "refused", str(error)
    except BaseException:
        return "raised", traceback.format_exc()


def _serve(beyond, modules):
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever is printed is no answer
    for module in modules:
        importlib.import_module(module)
    _limit_memory(beyond)
    output.write(b"!")
    output.flush()
    while True:
        try:
            call = pickle.loads(_read(sys.stdin.buffer))
        except EOFError:
            return
        _send(output, _answer(call))


if __name__ == "__main__":
    _serve(int(sys.argv[1]), sys.argv[2:])
