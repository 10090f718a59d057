"""``kineme generate`` and ``kineme export``: a symbol, a recording or a primitive as a new movement, or as code."""

from __future__ import annotations

from typing import Any

import click

from kineme.cli import options as opts
from kineme.cli.output import check_new, write, write_bytes
from kineme.cli.reading import layout_options, name_of_source, read_source
from kineme.reporting.text import printable

_BAD_FIT = 0.05  # of the extent of the recording
_MISSED = 0.01  # of the extent of a column


@click.command(cls=opts.GroupedCommand, short_help="Generate a movement from a symbol or a recording.")
@opts.source_options
@opts.heading("Movement")
@click.option(
    "--start", type=opts.NUMBERS, help="Where it starts, in all columns but discrete ones.  [default: as demonstrated]"
)
@click.option("--goal", type=opts.NUMBERS, help="Where it ends, likewise.  [default: as demonstrated]")
@click.option("--duration", type=opts.Finite(), help="Duration in seconds.  [default: as demonstrated]")
@click.option("--rate", type=opts.Finite(), default=100.0, show_default=True, help="Samples per second at least.")
@click.option("--settle", type=opts.Finite(), help="Continue past the duration until this close to the goal.")
@click.option("--obstacle", "obstacles", type=opts.NUMBERS, multiple=True, help="Point to avoid; may be repeated.")
@opts.specification_options
@layout_options
@opts.heading("Output")
@click.option("--save", type=opts.FILE, help="Save the primitive to this .kineme file.")
@click.option("--output", "-o", type=opts.FILE, default="-", show_default=True,
              help="A .csv, .npz, .json or .parquet file; - for the screen, as CSV or --json.")  # fmt: skip
@opts.json_option
@opts.plot_option
@opts.rerun_option
@opts.force_option
def generate(**options: Any) -> None:
    """Generate a movement from SOURCE: a symbol of a library, a recording, or a saved primitive (.kineme).

    The new movement has the columns of the recording, under their names: quaternions are of norm 1, a gripper steps
    when it did. Where the fit is far off the recording, a warning says so.

    As in:

    \b
    kineme generate wave --library actions/ --goal 0.4,0.2 --duration 2 -o wave.csv
    kineme generate wave.csv --goal 0.4,0.2 --duration 2 -o new.csv --plot new.png
    """  # noqa: D301 - a backspace tells click to keep the lines
    import numpy as np

    from kineme.dmp.generation.generate import MovementOptions, checked_point, in_turn
    from kineme.dmp.generation.generate import generate as make
    from kineme.io.writing.write_movement import encode_movement, write_movement

    for name in ("output", "save", "plot", "rerun"):
        check_new(options[name], options["force"], options["source"])
    learned = read_source(options)
    obstacles = options["obstacles"]
    if len({len(point) for point in obstacles}) > 1:
        raise click.BadParameter("expected obstacles of equally many dimensions", param_hint="--obstacle")
    given = {"start": options["start"], "goal": options["goal"], "obstacles": obstacles or None}
    points: dict[str, Any] = {name: None if point is None else np.array(point) for name, point in given.items()}
    for name in ("start", "goal"):
        checked_point(learned, points[name], f"--{name}")
        points[name], said = in_turn(learned, points[name], name)
        for sentence in said:
            write(f"note: --{printable(sentence)}", err=True)
    movement_options = MovementOptions(**points, **{name: options[name] for name in ("duration", "rate", "settle")})
    movement = make(learned, movement_options)
    warn_of_bad_fit(learned)
    if movement_options.goal is not None and movement_options.settle is None:
        _warn_of_missed_goal(learned, movement, movement_options.goal)
    if options["save"]:
        learned.primitive.save(options["save"])
    if options["plot"]:
        from kineme.dmp.generation.figure import draw_movement
        from kineme.reporting.figures import save_figure

        save_figure(draw_movement(learned, movement.columns, movement_options.obstacles), options["plot"])
    if options["rerun"]:
        from kineme.io.writing.rerun import movement_scene, write_rerun

        scene = movement_scene(name_of_source(options), movement.columns, movement.names)
        write_rerun(options["rerun"], [scene], replace=options["force"])
    if str(options["output"]) == "-":
        ending = ".json" if options["as_json"] else ".csv"
        write_bytes(encode_movement(movement.columns, ending, movement.names))
    else:
        write_movement(options["output"], movement.columns, movement.names)


def warn_of_bad_fit(learned: Any) -> None:
    """Say how far the primitive of a recording is off it, where that is much."""
    from kineme.dmp.generation.generate import largest_deviation

    off = largest_deviation(learned)
    if off is not None and off.share > _BAD_FIT:
        of = f"in its {printable(off.of)}, " if off.of else ""
        write(
            f"warning: the fit is off the recording {of}by up to {off.largest:.3g}, {100 * off.share:.2g} % of its "
            "extent; see it with --plot, and try more basis functions with --n-basis",
            err=True,
        )


def _warn_of_missed_goal(learned: Any, movement: Any, goals: Any) -> None:
    """Say how far from a goal a movement ends that still moves there, orientations aside."""
    about = learned.primitive.to_recording
    channels = about.moving if about else ()
    turned = {name for channel in channels if channel.kind == "orientation" for name in channel.columns}
    misses = []
    for name, goal in zip(learned.moving_columns, goals, strict=True):
        column = movement.columns["positions"][:, learned.columns.index(name)]
        if name not in turned and (extent := float(column.max() - column.min())) > 0.0:
            off = abs(float(column[-1]) - float(goal))
            misses.append((off / extent, off, name, extent))
    share, off, name, extent = max(misses, default=(0.0, 0.0, "", 0.0))
    if share > _MISSED:
        write(
            f"note: it ends {off:.3g} from its goal in {printable(name)}, where it still moves; to go on until it is "
            f"there, say for instance --settle {_MISSED * extent:.1g}",
            err=True,
        )


@click.command(cls=opts.GroupedCommand, short_help="Write a movement for C or ONNX.")
@opts.source_options
@opts.specification_options
@layout_options
@opts.heading("Output")
@click.option("--c", "header", type=opts.FILE, help="A C header that moves step by step, for microcontrollers.")
@click.option("--onnx", type=opts.FILE, help="An ONNX model from weights, starts and goals to movements.")
@click.option("--double", is_flag=True, help="64-bit numbers in the ONNX model, not 32.")
@click.option("--name", help="What names in the header begin with.  [default: the name of SOURCE]")
@opts.force_option
def export(**options: Any) -> None:
    """Write SOURCE, a symbol of a library, a recording, or a saved primitive (.kineme), to run without Python.

    The header (C99, C++11) needs nothing but math.h: a state, a start, a goal and a tempo that change on the way, a
    step. The model is what any runtime of ONNX reads.

    As in:

    \b
    kineme export wave --library actions/ --c wave.h
    kineme export wave.csv --c wave.h --onnx wave.onnx
    """  # noqa: D301 - a backspace tells click to keep the lines
    from kineme.dmp.export_c import c_header, c_name
    from kineme.dmp.export_onnx import onnx_model
    from kineme.reporting.atomic import write_atomically

    paths = [options["header"], options["onnx"]]
    if not any(paths):
        raise click.UsageError("expected a file to write: --c wave.h, --onnx wave.onnx, or both")
    for path in paths:
        check_new(path, options["force"], options["source"])
    if paths[0] == paths[1]:
        raise click.UsageError(f"expected two files, got {printable(paths[0])} for --c and --onnx")
    learned = read_source(options)
    warn_of_bad_fit(learned)
    name, primitive = options["name"] or name_of_source(options), learned.primitive
    # Both are complete before one is written.
    header = c_header(primitive, name).encode() if options["header"] else b""
    model = onnx_model(primitive, double=options["double"]) if options["onnx"] else b""
    size = f"{primitive.n_dims} dimensions, {primitive.dmp.n_basis} basis functions"
    if options["header"]:
        p = c_name(name)
        write(f"wrote {write_atomically(options['header'], header)}: {size}; {p}_start, {p}_aim, {p}_step")
    if options["onnx"]:
        write(f"wrote {write_atomically(options['onnx'], model)}: {size}; start, goal -> positions, velocities")
    about = primitive.recorded_as
    aside = [] if about is None else [channel.name for channel in about.channels if channel not in about.moving]
    if aside:
        write(f"note: without {printable(', '.join(aside))}, which is discrete: see kineme generate", err=True)
