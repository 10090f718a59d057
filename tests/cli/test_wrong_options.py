"""Every command with every option given what it cannot use: one message that names it, no traceback."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
import pytest
from commands import run

import kineme
from kineme.cli.main import main

HUGE, TEXT = str(10**30), "a lot"
COUNTS = (TEXT, "-1", "2.5", "nan", HUGE, "")
NUMBERS = (TEXT, "nan", "inf", "-inf", "", "1e999")
LAYOUT = {
    "--time": ("nowhere", ""),
    "--columns": ("nowhere,x", ""),
    "--movement": ("nowhere", ""),
    "--label-column": ("nowhere", ""),
    "--units": ("parsec", "nan", "-1", "0", "inf", ""),
    "--skip": ("everything", ""),
}
LIBRARY = {"--library": ("nowhere/at/all", "")}
GENERATE = {
    "--start": (TEXT, "1,nan", "1e308,1", "1,2,3", "", "1,,2"),
    "--goal": (TEXT, "inf,1", "1e308,1", "1,2,3", "", "1,"),
    "--duration": (*NUMBERS, "0", "-1", "1e300", "1e-300"),
    "--rate": (*NUMBERS, "0", "-1", "1e9", "1e12", "1e308", "1e-3"),
    "--settle": (*NUMBERS, "0", "-1"),
    "--obstacle": (TEXT, "nan,1", "1,2,3", "", "1"),
    "--index": (*COUNTS, "7"),
    "--formulation": ("unheard of", ""),
    "--n-basis": (*COUNTS, "0", "100000000"),
    "--save": ("nowhere/at/all.kineme",),
    "--output": ("new.xyz", "nowhere/at/all.csv"),
    "--plot": ("new.xyz", "nowhere/at/all.png"),
}
COMMANDS = {
    "generate g.csv": GENERATE,
    "inspect g.csv": LAYOUT | {"--plot": ("new.xyz", "nowhere/at/all.png")},
    "recognize g.csv -l actions": LAYOUT | LIBRARY | {"--error-rate": (*NUMBERS, "0", "1"), "--top": (*COUNTS, "0")},
    "learn g.csv -l actions": LAYOUT | {"--label": ("",)},
    "anchor -l actions": LIBRARY
    | {"--method": ("by eye", ""), "--clusters": (*COUNTS, "0"), "--min-members": (*COUNTS, "1"), "--accept": (TEXT,),
       "--reject": (TEXT,), "--names": ("nowhere.json",)},
    "evaluate g.csv": {"--protocol": (TEXT, ""), "--method": (TEXT, ""), "--splits": (*COUNTS, "0"),
                       "--shots": (*COUNTS, "0"), "--seed": COUNTS, "--jobs": (*COUNTS, "0")},
    "reproduce": {"--draws": (*COUNTS, "0"), "--seed": COUNTS},
    "library show CShape -l actions": LIBRARY,
    "library list -l actions": LIBRARY | {"--at": (*COUNTS, "999")},
    "library history -l actions": LIBRARY | {"--limit": (*COUNTS, "0")},
    "library delete -y -l actions": LIBRARY | {"--movement": (*COUNTS, "999")},
    "library rename CShape C -l actions": LIBRARY,
    "library nearest CShape -l actions": LIBRARY | {"-k": (*COUNTS, "0")},
    "library between CShape GShape -l actions": LIBRARY,
    "library ground CShape -l actions": LIBRARY | {"--by": ("luck", ""), "--output": ("nowhere/at/all.json",)},
    "library merge CShape GShape -l actions": {"--into": ("",)},
    "library split CShape -l actions --into new": {"--movement": (*COUNTS, "999")},
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("place")
    demos = kineme.load_lasa(["CShape", "GShape"])[5:9]
    x = demos[0].positions[::20]
    rows = np.column_stack((np.linspace(0.0, 1.0, len(x)), x))
    np.savetxt(place / "g.csv", rows, delimiter=",", header="t,x,y", comments="")
    with kineme.ActionLibrary(place / "actions", create=True) as library:
        library.learn(demos)
    return place


def _option_names(command, option):
    """How a message may name an option: as typed, or as the parameter that it sets."""
    words = command.split()
    found = main.commands[words[0]]
    if isinstance(found, click.Group):
        found = found.commands[words[1]]
    (parameter,) = (one for one in found.params if option in one.opts)
    return {option, option.lstrip("-").replace("-", "_"), option.lstrip("-").replace("-", " "), *parameter.opts}


def _shown(value):
    """How a message may show a value: as typed, in quotes, of a path its folder or ending."""
    path = Path(value)
    return {repr(value), repr(path.suffix), f"folder {path.parent} "} | ({value.strip()} - {""})


CASES = [
    (command, option, value)
    for command, options in COMMANDS.items()
    for option, values in options.items()
    for value in values
]


@pytest.mark.parametrize(("command", "option"), list(dict.fromkeys((one, option) for one, option, _ in CASES)))
def test_a_wrong_option_is_refused_by_name(folder, command, option):
    names = _option_names(command, option)
    for value in COMMANDS[command][option]:
        done = run(*command.split(), option, value, cwd=folder)
        said = done.stderr.replace("\n", " ")
        assert done.returncode in {1, 2}, (value, done)
        assert "Traceback" not in said
        assert any(name in said for name in names | _shown(value)), (value, said)
        assert not done.stdout.startswith(("{", "time")), value  # nothing that a robot could take for a movement


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e999"])
@pytest.mark.parametrize("option", ["--duration", "--rate", "--settle", "--start", "--goal"])
def test_a_number_that_is_not_finite_is_a_mistake_of_typing(folder, option, value):
    """Status 2, before anything is read."""
    done = run("generate", "g.csv", option, value, cwd=folder)
    assert done.returncode == 2, done
    assert f"got '{value}'" in done.stderr
