"""Exported primitives: the C header's size, time of a step and distance from the controller; the model of ONNX.

Three dimensions of 40 basis functions each, 2 s at steps of 1 ms. Where a compiler or package is missing, its rows are.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from shutil import which
from string import Template
from typing import NamedTuple

import numpy as np

import kineme
from bench.rows import Row
from bench.timing import medians
from kineme.dmp import c_header

N_DIMS, N_BASIS, DURATION, DT = 3, 40, 2.0, 1e-3


class Target(NamedTuple):
    """A processor, the compiler for it, and its flags; `runs` where its programs run here."""

    processor: str
    compiler: str
    flags: tuple[str, ...]
    numbers: str
    runs: bool = False


_FLOAT = "-DKINEME_FLOAT"
_ARM = ("-mthumb", "-mfloat-abi=hard")
TARGETS = (
    Target("x86-64", "gcc", ("-O2",), "double", runs=True),
    Target("x86-64", "gcc", ("-O2", _FLOAT), "single", runs=True),
    Target("Cortex-M7", "arm-none-eabi-gcc", ("-O2", "-mcpu=cortex-m7", "-mfpu=fpv5-d16", *_ARM), "double"),
    Target("Cortex-M4F", "arm-none-eabi-gcc", ("-O2", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", *_ARM, _FLOAT), "single"),
    Target("Cortex-M4F", "arm-none-eabi-gcc", ("-Os", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", *_ARM, _FLOAT), "single"),
)

#: A unit that keeps every function of the header, and tells the size of its state by that of an array.
UNIT = """#include "wave.h"
char state_size[sizeof(wave_state)];
int begin(wave_state *s, const wave_real *x, const wave_real *g, wave_real t) { return wave_start(s, x, g, t); }
int aim(wave_state *s, const wave_real *g, const wave_real *v) { return wave_aim(s, g, v); }
int go(wave_state *s, wave_real dt) { return wave_step(s, dt); }
"""

#: Steps a movement again and again: prints the fastest round's nanoseconds a step, then the positions of one movement.
PROGRAM = Template("""#define _POSIX_C_SOURCE 199309L
#include "wave.h"
#include <stdio.h>
#include <time.h>
int main(void)
{
    wave_state s;
    struct timespec a, b;
    double best = 1e9;
    int round, k, i;
    for (round = 0; round < $rounds; round++) {
        clock_gettime(CLOCK_MONOTONIC, &a);
        for (k = 0; k < 50; k++)
            for (wave_start(&s, NULL, NULL, $duration), i = 0; i < $steps; i++)
                wave_step(&s, (wave_real)$dt);
        clock_gettime(CLOCK_MONOTONIC, &b);
        double ns = ((double)(b.tv_sec - a.tv_sec) * 1e9 + (double)(b.tv_nsec - a.tv_nsec)) / (50.0 * $steps);
        best = ns < best ? ns : best;
    }
    printf("%.2f\\n", best);
    for (wave_start(&s, NULL, NULL, $duration), i = 0; i < $steps; i++) {
        wave_step(&s, (wave_real)$dt);
        printf("%.17g %.17g %.17g\\n", (double)s.position[0], (double)s.position[1], (double)s.position[2]);
    }
    return 0;
}
""")


def measure(quick: bool) -> list[Row]:
    """Rows of each target, and of the model of ONNX."""
    u = np.linspace(0.0, 1.0, 200)[:, None]
    positions = u * [0.4, -0.2, 0.3] + 0.1 * np.sin(np.pi * u * [1, 2, 3])
    primitive = kineme.DMP(n_basis=N_BASIS).learn([kineme.Trajectory(DURATION * u[:, 0], positions)])[0]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "wave.h").write_text(c_header(primitive, "wave"), encoding="utf-8")
        rows = [row for target in TARGETS for row in _header_rows(target, primitive, Path(folder), quick)]
        return [*rows, *_model_rows(primitive, Path(folder), quick)]


def _header_rows(target: Target, primitive: kineme.dmp.Primitives, folder: Path, quick: bool) -> list[Row]:
    name = f"{target.processor}, {' '.join(target.flags[:1])}, {target.numbers}"
    compiler = which(target.compiler)
    if compiler is None:
        print(f"{name}: not measured, no {target.compiler}", file=sys.stderr)
        return []
    version = _output(compiler, "-dumpfullversion").strip()
    unit = folder / "unit.o"
    (folder / "unit.c").write_text(UNIT, encoding="utf-8")
    strict = ("-std=c99", "-Wall", "-Wextra", "-Werror")
    _output(compiler, *strict, *target.flags, "-c", folder / "unit.c", "-o", unit)
    # Columns text, data and bss, whose only content is an array as large as the state.
    code, data, state = map(int, _output(compiler.removesuffix("gcc") + "size", unit).split()[6:9])
    details = {"compiler": f"gcc {version}", "flags": " ".join(target.flags)}
    rows = [
        Row(f"{name}: code and tables", "kB", (code + data) / 1000, details=details),
        Row(f"{name}: state", "bytes", state),
    ]
    if not target.runs:
        return rows
    steps = round(DURATION / DT)
    numbers = {"rounds": 3 if quick else 25, "duration": DURATION, "steps": steps, "dt": DT}
    (folder / "program.c").write_text(PROGRAM.substitute(numbers), encoding="utf-8")
    _output(compiler, *target.flags, folder / "program.c", "-o", folder / "program", "-lm")
    said = _output(folder / "program").splitlines()
    controller = primitive.controller(DT)
    expected = np.array([controller.step().position for _ in range(steps)])
    distance = np.abs(np.loadtxt(said[1:]) - expected).max() / primitive.extents.max()
    bound = 1e-4 if _FLOAT in target.flags else 1e-5
    return [
        *rows,
        Row(f"{name}: a step", "ns", float(said[0])),
        Row(f"{name}: off the controller, of the extent", "", distance, target=("<=", bound)),
    ]


def _output(*command: str | Path) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def _model_rows(primitive: kineme.dmp.Primitives, folder: Path, quick: bool) -> list[Row]:
    if not (find_spec("onnx") and find_spec("onnxruntime")):
        print("ONNX: not measured, onnx or onnxruntime not installed", file=sys.stderr)
        return []
    import onnxruntime

    from kineme.dmp import onnx_model

    path = folder / "wave.onnx"
    path.write_bytes(onnx_model(primitive))
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(path, options)
    inputs = {"start": np.zeros((1, N_DIMS), np.float32), "goal": np.ones((1, N_DIMS), np.float32)}

    def several() -> None:
        for _ in range(100):
            session.run(None, inputs)

    seconds = medians({"onnx": several}, 3 if quick else 15)["onnx"] / 100
    return [
        Row("ONNX, three dimensions: file", "kB", path.stat().st_size / 1000),
        Row("ONNX, three dimensions: a movement", "us", 1e6 * seconds),
    ]
