"""Imports go only downwards, in the order in which CONTRIBUTING.md lists chapters and their rooms."""

from __future__ import annotations

import ast
import re
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "kineme"
FRONT_DOOR = ("__init__", "__main__", "control", "orientation", "styles")  # they may import everything


@cache  # the sources do not change while they are read here
def _layers():
    """Chapter, or chapter/room -> its line in the list, from the bottom up."""
    listed = (ROOT / "CONTRIBUTING.md").read_text().partition("    src/kineme/\n")[2].partition("    experiments/")[0]
    layers, chapter = {}, ""
    for height, line in enumerate(listed.splitlines()):
        names = re.split(r"\s{2,}", line.strip())[0].replace("/", "").split(", ")
        if line.startswith(" " * 8):
            names = [f"{chapter}/{name}" for name in names]
        else:
            chapter = names[-1]
        layers.update(dict.fromkeys(names, height))
    return layers


@cache
def _all_imports(path):
    """Full names of all that a file imports, at the top or inside functions: of ``from a import b`` it is a.b."""
    names = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}: import with the full name"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def _imported(path):
    """Modules of kineme that a file imports, each as its parts."""
    return [name.split(".") for name in _all_imports(path) if name.startswith("kineme.")]


@cache
def _modules():
    return [path for path in sorted(PACKAGE.rglob("*.py")) if path.stem not in FRONT_DOOR or path.parent != PACKAGE]


def _chapter_of(path):
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def _chapter(room):
    return room.partition("/")[0]


def _room_of(names):
    """Of a module's names below kineme: "chapter/room", or None for a file that lies in its chapter itself."""
    room = "/".join(names[:2])
    return room if (PACKAGE / room).is_dir() and len(names) > 1 else None


def test_modules_import_from_their_own_chapter_and_from_those_below():
    layers = _layers()
    unlisted = {_chapter_of(path) for path in _modules()} - set(layers)
    assert not unlisted, "list these chapters in CONTRIBUTING.md"
    upwards = [
        f"{path.relative_to(PACKAGE)} imports {chapter}"
        for path in _modules()
        for _, chapter, *_ in _imported(path)
        if layers[chapter] > layers[_chapter_of(path)]
    ]
    assert not upwards


def test_modules_import_from_their_own_room_and_from_those_below():
    layers = _layers()
    rooms = {path: _room_of(path.relative_to(PACKAGE).with_suffix("").parts) for path in _modules()}
    assert not {room for room in rooms.values() if room} - set(layers), "list these rooms in CONTRIBUTING.md"
    upwards = [
        f"{path.relative_to(PACKAGE)} imports {other}"
        for path, room in rooms.items()
        for _, *names in _imported(path)
        if room and (other := _room_of(names)) and _chapter(room) == _chapter(other) and layers[other] > layers[room]
    ]
    assert not upwards


def test_no_files_import_each_other_in_a_circle():
    """Not even for types, or within functions."""
    names = {".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts): path for path in _modules()}
    graph = {name: {one if one in names else one.rpartition(".")[0] for one in _all_imports(path)} - {name}
             for name, path in names.items()}  # fmt: skip
    assert len(list(TopologicalSorter(graph).static_order())) >= len(names)  # a CycleError names the files


def test_only_commands_import_experiments_and_experiments_no_front_ends():
    experiments = sorted((ROOT / "experiments" / "kineme_experiments").rglob("*.py"))
    assert experiments
    assert not [path for path in experiments for _, chapter, *_ in _imported(path) if chapter in {"cli", "studio"}]
    importing = {
        _chapter_of(path) for path in _modules() for name in _all_imports(path) if name.startswith("kineme_experiments")
    }
    assert importing == {"cli"}


def test_every_chapter_and_room_that_is_listed_exists():
    assert not [name for name in _layers() if not (PACKAGE / name).is_dir() and not (PACKAGE / f"{name}.py").is_file()]


def test_kernels_know_nothing_of_movements():
    imported = {chapter for path in (PACKAGE / "kernels").glob("*.py") for _, chapter, *_ in _imported(path)}
    assert imported <= {"kernels", "runtime", "validation", "errors", "sampling", "_lazy"}


@cache
def _compiled_modules():
    """Modules with compiled functions, and the one that keeps their machine code: importing them imports Numba."""
    jitted = [path for path in _modules() if re.search(r"^@_?jit|= jit\(", path.read_text(), re.MULTILINE)]
    return {".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts): path for path in jitted} | {
        "kineme.runtime.machine_code": PACKAGE / "runtime" / "machine_code.py"
    }


def test_numba_and_compiled_modules_are_loaded_in_one_place_only():
    """Threads that import parts of Numba at the same time break it for the rest of the process."""
    compiled = _compiled_modules()
    imports = [
        (path.relative_to(PACKAGE), name)
        for path in _modules()
        if path not in compiled.values()
        for name in _all_imports(path)
    ]
    assert not [pair for pair in imports if pair[1].partition(".")[0] == "numba"], "load Numba by runtime.compiled"
    loaded = [(path, name) for path, name in imports if {name, name.rpartition(".")[0]} & set(compiled)]
    assert not loaded, "use kineme.runtime.compiled.compiled_module"


def test_the_modules_that_are_asked_for_have_compiled_functions():
    assert {"kernels", "dmp", "movements"} <= {name.split(".")[1] for name in _compiled_modules()}
    for path in _modules():
        for name in re.findall(r"compiled_module\(\"(.*?)\"\)", path.read_text()):
            assert name in _compiled_modules(), path
