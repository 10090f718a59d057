"""``kineme export``: a symbol, a recording or a saved primitive as files that run without Python."""

from __future__ import annotations

from typing import Any

import click

from kineme.cli.generate import warn_of_bad_fit
from kineme.cli.options import FILE, GroupedCommand, force_option, heading, source_options, specification_options
from kineme.cli.output import check_new, write
from kineme.cli.reading import layout_options, name_of_source, read_source
from kineme.reporting.text import printable


@click.command(cls=GroupedCommand, short_help="Write a movement for C or ONNX.")
@source_options
@specification_options
@layout_options
@heading("Output")
@click.option("--c", "header", type=FILE, help="A C header that moves step by step, for microcontrollers.")
@click.option("--onnx", type=FILE, help="An ONNX model from weights, starts and goals to movements.")
@click.option("--double", is_flag=True, help="64-bit numbers in the ONNX model, not 32.")
@click.option("--name", help="What names in the header begin with.  [default: the name of SOURCE]")
@force_option
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
