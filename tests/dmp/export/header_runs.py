"""Headers compiled as C or C++ and called from here, beside the controller that they stand for."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from typing import NamedTuple

import numpy as np

from kineme.dmp import c_header

WARNINGS = ("-Wall", "-Wextra", "-Werror", "-pedantic", "-Wshadow")
COMPILERS = {"gcc": ("-std=c99", "-xc"), "g++": ("-std=c++11", "-xc++")}

# A row of commands is dt, tempo, whether the goal is set, the goal, its velocity.
_DRIVER = """
#include "movement.h"

int run(int n, const double *place, const double *commands, double *states);

int run(int n, const double *place, const double *commands, double *states)
{
    enum { d = movement_dims };
    movement_state s;
    movement_real start[d], goal[d], velocity[d];
    int i, k, used = 1;
    for (k = 0; k < d; k++) {
        start[k] = (movement_real)place[k];
        goal[k] = (movement_real)place[d + k];
    }
    if (!movement_start(&s, start, goal, (movement_real)place[2 * d]))
        return 0;
    for (i = 0; i <= n; i++) {
        for (k = 0; k < d; k++) {
            states[k] = (double)s.position[k];
            states[d + k] = (double)s.velocity[k];
            states[2 * d + k] = (double)s.acceleration[k];
            states[3 * d + k] = (double)s.goal[k];
        }
        states[4 * d] = s.u;
        states += 4 * d + 1;
        if (i == n)
            break;
        s.tempo = (movement_real)commands[1];
        if (commands[2] > 0) {
            for (k = 0; k < d; k++) {
                goal[k] = (movement_real)commands[3 + k];
                velocity[k] = (movement_real)commands[3 + d + k];
            }
            used &= movement_aim(&s, goal, commands[2] > 1 ? velocity : NULL);
        }
        used &= movement_step(&s, (movement_real)commands[0]);
        commands += 3 + 2 * d;
    }
    return used;
}
"""


class Command(NamedTuple):
    """One step of a movement."""

    dt: float
    tempo: float = 1.0
    goal: np.ndarray | None = None
    goal_velocity: np.ndarray | None = None


def compiler_of(language):
    """Path of a compiler, or None."""
    return shutil.which(language)


def compiled(primitive, folder, language="gcc", flags=()):
    """The header of a primitive as a function of place and commands; no warning passes."""
    (folder / "movement.h").write_text(c_header(primitive))
    (folder / "driver.c").write_text(
        _DRIVER.replace("int run(int", 'extern "C" int run(int', 1) if language == "g++" else _DRIVER
    )
    library = folder / "driver.so"
    options = [*COMPILERS[language], *WARNINGS, *flags, "-shared", "-fPIC", "driver.c", "-xnone", "-o", library, "-lm"]
    done = subprocess.run([language, *options], cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    run = ctypes.CDLL(str(library)).run
    d = primitive.n_dims

    def move(commands, start=None, goal=None, tau=0.0):
        place = np.concatenate(
            (primitive.starts[0] if start is None else start, primitive.goals[0] if goal is None else goal, [tau])
        )
        rows = np.zeros((len(commands), 3 + 2 * d))
        for row, command in zip(rows, commands, strict=True):
            row[:2] = command.dt, command.tempo
            if command.goal is not None:
                row[2], row[3 : 3 + d] = 1, command.goal
            if command.goal_velocity is not None:
                row[2], row[3 + d :] = 2, command.goal_velocity
        states = np.zeros((len(commands) + 1, 4 * d + 1))
        pointer = ctypes.POINTER(ctypes.c_double)
        used = run(len(rows), *(array.ctypes.data_as(pointer) for array in (place, rows, states)))
        return bool(used), states

    return move


def controlled(primitive, commands, start=None, goal=None, tau=None):
    """The same by the controller."""
    controller = primitive.controller(commands[0].dt, start=start, goal=goal, duration=tau)

    def row(state):
        return np.concatenate((state.position, state.velocity, state.acceleration, state.goal, [state.progress]))

    rows = [row(controller.state)]
    for command in commands:
        state = controller.step(
            goal=command.goal, goal_velocity=command.goal_velocity, tempo=command.tempo, dt=command.dt
        )
        assert not state.status.rejected, state.status
        rows.append(row(state))
    return np.array(rows)
