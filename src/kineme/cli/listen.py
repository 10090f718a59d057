"""``kineme listen`` and ``kineme ros``: live sensors in, symbols out."""

from __future__ import annotations

import json
import math
import signal
from collections.abc import Callable
from functools import partial
from typing import Any

import click

from kineme.cli.options import Finite, GroupedCommand, Parsed, given_options, heading, library_option, opened, under
from kineme.cli.output import write
from kineme.reporting.text import printable


def _place(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise ValueError(f"expected a host and a port, as 127.0.0.1:9001, got {text!r}")
    return host.strip("[]"), int(port)


_HEADS = Parsed("a,b,...", lambda text: tuple(name.strip() for name in text.split(",")))

#: Options of whatever listens.
listening_options = under(
    "Movements",
    click.option("--columns", type=_HEADS, default=(), help="Columns of the stream in the order of the library's, by "
                 "names or numbers from 0.  [default: by their names]"),
    click.option("--rest", type=Finite(0.0, min_open=True), default=0.3, show_default=True,
                 help="A movement is over when nothing has moved for so long [s]."),
    click.option("--only-ended", is_flag=True, help="Print nothing of movements under way."),
    click.option("--seconds", type=Finite(0.0, min_open=True), help="End after so long.  [default: with Ctrl-C]"),
    click.option("--json", "as_json", is_flag=True, help="A line of JSON for each symbol."),
)  # fmt: skip


@click.command(cls=GroupedCommand, short_help="Name the movements of a live sensor, over LSL or OSC.")
@library_option
@click.option("--from", "source", type=click.Choice(["lsl", "osc"]), required=True, help="Where samples come from.")
@click.option("--to", "sinks", type=click.Choice(["lsl", "osc"]), multiple=True, help="Where symbols go, too.")
@listening_options
@heading("LSL")
@click.option("--name", help="Name of the stream.  [default: the first that fits]")
@click.option("--type", "kind", help="Type of the stream, as MoCap.")
@click.option("--names", is_flag=True, help="Markers are the names of ended movements.  [default: JSON of all]")
@click.option("--lan", is_flag=True, help="Find, and be found by, other machines.  [default: this machine alone]")
@heading("OSC")
@click.option("--port", type=click.IntRange(1, 65535), default=9000, show_default=True, help="UDP port to listen at.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen at; OSC knows no passwords.")
@click.option("--address", help="Address of the messages, as /hand.  [default: that of the first that the "
              "library can use]")  # fmt: skip
@click.option("--stamped", is_flag=True, help="The first number of a message is its time [s].")
@click.option("--send-to", type=Parsed("host:port", _place), default="127.0.0.1:9001", show_default=True,
              help="Where symbols go.")  # fmt: skip
def listen(folder: Any, source: str, sinks: tuple[str, ...], **options: Any) -> None:
    """Recognize movements while they are made: samples of a sensor in, names of symbols out.

    A movement begins when the sensor moves and ends when it rests, or when no more samples come. Its name is said as
    soon as it is decided, and again, with the unknown, when it is over. The library is only read; what others teach it
    meanwhile is known from the next movement on. Extras: lsl, osc.

    \b
    kineme listen --library actions/ --from lsl --type MoCap --to lsl
    kineme listen --library actions/ --from osc --address /hand --to osc --send-to 127.0.0.1:9001
    """  # noqa: D301 - a backspace tells click to keep the lines
    from kineme.sensors.protocols import ADAPTERS

    inward, outward = ADAPTERS[source], {protocol: ADAPTERS[protocol] for protocol in sinks}
    used = {*inward.takes, *(name for adapter in outward.values() for name in adapter.gives)}
    every = {name for adapter in ADAPTERS.values() for name in (*adapter.takes, *adapter.gives)}
    if useless := given_options(every - used):
        raise click.UsageError(f"expected --from or --to with the protocol of {', '.join(useless)}")

    def connected(_: Any, refusal: Callable[[Any], str]) -> list[Any]:
        receivers = [
            adapter.sink(**{name: options[name] for name in adapter.gives}, same_clock=protocol == source)
            for protocol, adapter in outward.items()
        ]
        given = {**options, "refusal": refusal}
        return [inward.source(**{name: given[name] for name in inward.takes}), *receivers]

    _run(folder, options, connected)


@click.command(cls=GroupedCommand, short_help="Name the movements of a topic of ROS 2; move an arm.")
@library_option
@click.option("--topic", help="Topic with samples, as /tip_pose: poses, joints, and what bags are read by.")
@click.option("--frame", help="Two frames of /tf, as base:tip.")
@listening_options
@heading("Arm")
@click.option("--execute", is_flag=True, help="Move an arm as the symbols whose names come on kineme/execute.")
@click.option("--robot", help="panda, ur5e, wam, so101, or a .urdf file.")
@click.option("--tip", help="Link that follows the movement.  [default: the end of the arm]")
@click.option("--action", default="/joint_trajectory_controller/follow_joint_trajectory", show_default=True,
              help="Action of the controller.")  # fmt: skip
def ros(folder: Any, topic: str | None, frame: str | None, **options: Any) -> None:
    """Recognize movements while they are made: a node of ROS 2 that publishes symbols on kineme/symbol, as JSON.

    kineme/state holds the last one, also for nodes that come later. Without --execute nothing moves. With it the name
    of a symbol on kineme/execute is planned from where /joint_states says that the arm stands, checked, and sent as a
    FollowJointTrajectory; what became of it is on kineme/executed.

    \b
    kineme ros --library actions/ --topic /tip_pose
    kineme ros --library actions/ --frame base:tip --execute --robot panda
    """  # noqa: D301 - a backspace tells click to keep the lines
    if options["execute"] != (options["robot"] is not None):
        raise click.UsageError("expected --execute and --robot, or neither")
    if (topic is None) == (frame is None):
        raise click.UsageError("expected one of --topic and --frame")

    def connected(library: Any, _: Any) -> list[Any]:
        from kineme.planning.preview import plan_symbol
        from kineme.robots.models.robot import load
        from kineme.sensors.ros import ArmClient, RosNode

        node = RosNode(topic, frame)
        if not options["execute"]:
            return [node, node]
        robot = load(options["robot"], options["tip"])
        plan = partial(plan_symbol, library, robot)
        return [node, node, ArmClient(node, robot.joints, plan, options["action"])]

    _run(folder, options, connected)


def _run(folder: Any, options: dict[str, Any], connected: Callable[[Any, Callable[[Any], str]], list[Any]]) -> None:
    """Listen to the source that is connected first, with the sinks behind it, until Ctrl-C; say what it was.

    It is connected with the library and with what refuses columns that cannot be used.
    """
    from kineme.sensors.listen import Listener, listen

    def tell(sentence: str) -> None:
        write(f"kineme: {printable(sentence)}", err=True)

    with opened(folder) as library:
        listener = Listener(library, tell, options["rest"], options["columns"])
        source, *sinks = connected(library, listener.refusal)
        sinks.append(_Screen(options["as_json"], options["only_ended"]))
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does
        try:
            write("listening; stop it with Ctrl-C", err=True)
            summary = listen(listener, source, sinks, options["seconds"] or math.inf)
        finally:
            signal.signal(signal.SIGTERM, before)
    write("\n".join(summary.lines()), err=True)


class _Screen:
    """Standard output as a sink: a line for each symbol."""

    def __init__(self, as_json: bool, only_ended: bool) -> None:
        self._as_json, self._only_ended = as_json, only_ended

    def send(self, symbol: Any) -> None:
        """Print a symbol."""
        name, seconds = printable(symbol.name), symbol.end - symbol.start
        if self._as_json and (symbol.is_over or not self._only_ended):
            write(json.dumps(symbol.to_dict()))
        elif symbol.is_over:
            write(f"{name}  {symbol.certainty}, {symbol.confidence:.2f}, {seconds:.1f} s")
        elif not self._only_ended:
            write(f"  {name}? ({symbol.confidence:.2f})")

    def close(self) -> None:
        """Leave standard output open."""
