"""The helper that runs calls under limits sees every way in which they can fail, and goes on."""

from __future__ import annotations

import os
import signal
import time

import pytest

from limited_child import MIB, LimitedChild


def die():
    os.kill(os.getpid(), signal.SIGSEGV)


def hang():
    time.sleep(60)


def eat():
    return bytearray(4096 * MIB)


@pytest.mark.skipif(os.name != "posix", reason="limits and signals are those of POSIX systems")
def test_the_child_tells_what_happens():
    with LimitedChild(("test_limited_child",), memory=512 * MIB, seconds=2.0) as child:
        for what, how in (("die", "died"), ("hang", "hung"), ("eat", "raised")):
            assert child.call(f"test_limited_child:{what}").how == how
            assert child.call("builtins:len", "abc") == ("done", 3)
