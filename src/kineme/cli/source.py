"""SOURCE of ``generate`` and ``move``: a symbol of a library, a recording, or a saved primitive."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from kineme.cli.options import SPECIFICATION
from kineme.cli.reading import LAYOUT_OPTIONS, read
from kineme.reporting.text import printable


def read_source(options: dict[str, Any]) -> Any:
    """The primitive of a symbol, a recording or a file, with the recording that it is of."""
    source = options["source"]
    if _is_symbol(source, options["folder"]):
        _check_of_symbol(source)
        from kineme.library.grounding import learned_of
        from kineme.library.library import ActionLibrary

        with ActionLibrary(options["folder"], read_only=True) as library:
            return learned_of(library.store, source)
    from kineme.dmp.discrete.dmp import DMP
    from kineme.dmp.generation.learned import SAVED, Learned, learn_one, load_saved

    if source != "-" and not Path(source).exists():
        raise FileNotFoundError(
            f"expected a recording or a saved primitive, found no file {printable(source)}; "
            "for a symbol, name its --library"
        )
    if Path(source).suffix.lower() == SAVED:
        return Learned(_chosen(load_saved(Path(source)), options))
    dmp = DMP(**{name: options[name] for name in SPECIFICATION})
    recordings = read(Path(source), {name: options[name] for name in LAYOUT_OPTIONS})
    return learn_one(_chosen(recordings, options), dmp)


def _check_of_symbol(source: str) -> None:
    """Refuse options that say how a recording is read or learned: a symbol of a library was when it was learned."""
    context = click.get_current_context()
    for option in context.command.params:
        is_given = context.get_parameter_source(option.name or "") == ParameterSource.COMMANDLINE
        if is_given and option.name in (*LAYOUT_OPTIONS, *SPECIFICATION, "index"):
            raise click.UsageError(
                f"expected {option.opts[0]} with a recording, got it with {printable(source)}, a symbol of a library: "
                f"its columns and primitives are those that it was learned with; say {option.opts[0]} to kineme learn"
            )


def name_of_source(options: dict[str, Any]) -> str:
    """The name of the symbol, or that of the file without its ending."""
    source = options["source"]
    if not _is_symbol(source, options["folder"]):
        return Path(source).stem
    from kineme.library.library import ActionLibrary

    with ActionLibrary(options["folder"], read_only=True) as library:
        return next((one.name for one in library.symbols() if one.id == source), str(source))


def _chosen(several: Any, options: dict[str, Any]) -> Any:
    """The one that is asked for by --index, or the only one."""
    n, index = len(several), options["index"]
    if index is None and n > 1:
        raise click.UsageError(f"expected one movement, {printable(options['source'])} holds {n}; choose with --index")
    if index is not None and index >= n:
        raise click.BadParameter(f"{printable(options['source'])} holds {n}, counted from 0", param_hint="--index")
    return several[index or 0]


def _is_symbol(source: str, folder: Path | None) -> bool:
    """Whether SOURCE is a symbol: with --library always; with a library from the environment, unless a file exists."""
    given = click.get_current_context().get_parameter_source("folder")
    return folder is not None and (given != ParameterSource.ENVIRONMENT or not Path(source).exists())
