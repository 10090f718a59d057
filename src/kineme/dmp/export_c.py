"""A primitive as one C header, which moves it step by step where there is no Python."""

from __future__ import annotations

import math
import re
import textwrap
from hashlib import sha256
from string import Template
from typing import Any

import numpy as np

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.discrete.specification import CLOSED, HANDOVER, ZERO
from kineme.errors import SpecificationError

_LONGEST_NAME = 40
_WIDTH = 110  # of lines of tables
_PER_GAP = 8  # Simpson intervals between neighboring centers; a control loop takes one a step
_PER_TIME_CONSTANT = 10  # and for each time constant of spring and phase
_MOST_INTERVALS = 1e6  # in a duration, which a step may take at most
_LARGEST_SINGLE = 1e15  # of all numbers in a header: squares, and products of two, are numbers of 32 bits
_CRITICAL = 1e-12  # of K: K - (D / 2)^2 that is rounding

#: Formulation -> C of the coupling at the phase s; see `FORMULATIONS`.
_COUPLINGS = {
    "original": "0",
    "bio-inspired": "-${p}_K * s",
    "amplitude-scaled": "-${p}_K * s",
    "decoupled": "-${p}_K * (1 + ${p}_late) * (s * s * s) / (s * s * s + ${p}_late)",
}

#: Gating -> C of the factor of f at the phase s; see `GaussianBasis.gate`.
_GATES = {"phase": "s", "none": "s < ${p}_end ? s / ${p}_end : 1"}

#: C of exp(-D h / 2) times cos(b h) and sin(b h) / b below critical damping, and its limits; see `transition`.
_TRANSITIONS = {
    0: "cosine = ${p}_exp(-${p}_a * h), sine = cosine * h",
    1: """fading = ${p}_exp(-${p}_a * h), cosine = fading * (${p}_real)cos(${p}_b * h),
        sine = fading * (${p}_real)sin(${p}_b * h) / ${p}_b""",
    -1: """fading = ${p}_exp(-${p}_slow * h) / 2, cosine = fading * (1 + ${p}_exp(-2 * ${p}_b * h)),
        sine = -fading * (${p}_real)expm1(-2 * ${p}_b * h) / ${p}_b""",
}

#: Formulation -> C of what f is multiplied by for a new g - x0, `a`.
_RATIOS = {
    "original": """\
    for (k = 0; k < ${p}_dims; k++)
        if (${p}_learned[k] != 0)
            ratio[k] = a[k] / ${p}_learned[k];
        else if (a[k] > ${p}_nothing || a[k] < -${p}_nothing)
            return 0; /* the demonstration ends where it starts in this dimension */
""",
    "amplitude-scaled": """\
    for (k = 0; k < ${p}_dims; k++)
        sum += a[k] * a[k];
    for (k = 0; k < ${p}_dims && ${p}_distance > 0; k++)
        ratio[k] = (${p}_real)sqrt(sum) / ${p}_distance;
""",
}

_HEADER = """\
/* A movement for real-time loops: a Dynamical Movement Primitive, written by kineme.
 *
 *     formulation $formulation, fit $fit, $n basis functions, stiffness $stiffness, gating $gating
 *     columns: $columns
 *
 *     ${p}_state s;
 *     ${p}_start(&s, NULL, NULL, 0);    as demonstrated; or arrays start and goal, and a duration [s]
 *     while (s.u < 1) {
 *         ${p}_aim(&s, goal, NULL);     a new goal, and its velocity per second or NULL; 0 if it cannot be used
 *         s.tempo = 0.5;                speed of the phase from here on; 0 is a pause
 *         ${p}_step(&s, 0.001);         0 if dt or tempo cannot be used: dt above 0, a duration at most in a step
 *         use(s.position, s.velocity, s.acceleration);
 *     }
 *
 * It allocates nothing, and a state belongs to one thread. Define KINEME_FLOAT for single precision.
 */
#ifndef KINEME_${guard}_H
#define KINEME_${guard}_H

#include <math.h>
#include <stddef.h>

#ifdef KINEME_FLOAT
${single}typedef float ${p}_real;
static const ${p}_real ${p}_limit = 1e30f; /* of positions and rates */
static inline ${p}_real ${p}_exp(${p}_real x) { return expf(x); }
#else
typedef double ${p}_real;
static const ${p}_real ${p}_limit = 1e150;
static inline ${p}_real ${p}_exp(${p}_real x) { return exp(x); }
#endif

enum { ${p}_dims = $d, ${p}_functions = $n };

$tables
typedef struct {
    ${p}_real position[$d], velocity[$d], acceleration[$d]; /* now, per second; a measured position may be written */
    ${p}_real goal[$d], drift[$d]; /* in force, and its velocity per second; see ${p}_aim */
    ${p}_real tempo; /* may be written */
    double time, u; /* since the start [s], and in durations: 1 at the end of the demonstration */
    ${p}_real start[$d], tau, rate, pace[$d], ratio[$d], shape[$d + 1], h, carry[6]; /* its own */
} ${p}_state;

/* f of each dimension, scaled, and behind them the coupling, at u durations. */
static inline void ${p}_shape(${p}_real u, ${p}_real *shape)
{
    const int last = ${p}_functions - 1, nearest = u < 1 ? (int)(u * last + (${p}_real)0.5) : last;
    const ${p}_real s = ${p}_exp(-${p}_alpha * u), gate = $gate;
    const ${p}_real least = (s - ${p}_centers[nearest]) * ${p}_widths[nearest];
    ${p}_real z, psi, sum = 0;
    int way, i, k;
    for (k = 0; k < ${p}_dims; k++)
        shape[k] = 0;
    for (way = -1; way <= 1; way += 2) /* outwards from the nearest center, until functions vanish */
        for (i = way < 0 ? nearest : nearest + 1; i >= 0 && i <= last; i += way) {
            z = (s - ${p}_centers[i]) * ${p}_widths[i];
            z = z * z - least * least;
            if (z > 30)
                break;
            psi = ${p}_exp(-z);
            sum += psi;
            for (k = 0; k < ${p}_dims; k++)
                shape[k] += psi * ${p}_weights[i][k];
        }
    for (k = 0; k < ${p}_dims; k++)
        shape[k] *= gate / sum;
    shape[${p}_dims] = $coupling;
}

/* exp(A h), row by row, of A = [[0, 1], [-K, -D]]. */
static inline void ${p}_transition(${p}_real h, ${p}_real *carry)
{
    const ${p}_real $transition;
    carry[0] = cosine + ${p}_a * sine;
    carry[1] = sine;
    carry[2] = -${p}_K * sine;
    carry[3] = cosine - ${p}_a * sine;
}

/* That, and the last column of exp(A h / 2), for all steps of one length. */
static inline void ${p}_prepare(${p}_state *s, ${p}_real h)
{
    ${p}_transition(h / 2, s->carry);
    s->carry[4] = s->carry[1];
    s->carry[5] = s->carry[3];
    ${p}_transition(h, s->carry);
    s->h = h;
}

static inline int ${p}_usable(${p}_real x)
{
    return x < ${p}_limit && x > -${p}_limit;
}

/* A goal, NULL for the one in force, and its velocity per second, NULL for rest. 0, and no change, if unusable. */
static inline int ${p}_aim(${p}_state *s, const ${p}_real *goal, const ${p}_real *velocity)
{
    const ${p}_real remaining = (${p}_real)(1 - s->u) * (s->rate > 0 ? 1 / s->rate : s->tau);
    ${p}_real g[$d], v[$d], a[$d], ratio[$d]$sum;
    int k;
    for (k = 0; k < ${p}_dims; k++) {
        g[k] = goal ? goal[k] : s->goal[k];
        v[k] = velocity ? velocity[k] : 0;
        a[k] = g[k] + remaining * v[k] - s->start[k];
        ratio[k] = 1;
        if (!${p}_usable(v[k]) || !${p}_usable(a[k]))
            return 0;
    }
$ratio    for (k = 0; k < ${p}_dims; k++) {
        s->ratio[k] = ratio[k];
        s->goal[k] = g[k];
        s->drift[k] = v[k];
    }
    return 1;
}

/* To the start; NULL and 0 are the start, goal and duration [s] of the demonstration. 0 if one cannot be used. */
static inline int ${p}_start(${p}_state *s, const ${p}_real *start, const ${p}_real *goal, ${p}_real tau)
{
    int k;
    s->tau = tau != 0 ? tau : ${p}_tau;
    s->rate = 1 / s->tau;
    s->tempo = 1;
    s->time = s->u = 0;
    ${p}_prepare(s, 1 / ${p}_intervals);
    ${p}_shape(0, s->shape);
    for (k = 0; k < ${p}_dims; k++) {
        s->start[k] = s->position[k] = start ? start[k] : ${p}_x0[k];
        if (!${p}_usable(s->start[k]))
            return 0;
    }
    if (!(s->tau > 0) || !${p}_usable(s->tau) || !${p}_usable(s->rate) || !${p}_aim(s, goal ? goal : ${p}_g, NULL))
        return 0;
    for (k = 0; k < ${p}_dims; k++) {
        s->pace[k] = ${p}_v0[k];
        s->velocity[k] = s->rate * s->pace[k];
        s->acceleration[k] = s->rate * s->rate
            * ((${p}_K + s->shape[${p}_dims]) * (s->goal[k] - s->start[k]) + s->shape[k] * s->ratio[k]
               - ${p}_D * s->pace[k]);
    }
    return 1;
}

/* On by dt [s]: the spring exactly, f and the coupling by Simpson's rule. 0 if it stays where it is. */
static inline int ${p}_step(${p}_state *s, ${p}_real dt)
{
    const ${p}_real rate = s->tempo / s->tau, du = rate * dt, begin = (${p}_real)s->u;
    const ${p}_real to_end = begin >= 1 ? 0 : 1 - begin < du ? 1 - begin : du; /* at u = 1 f may have a kink */
    ${p}_real x[$d], v[$d], ahead[$d], pace[$d], force[$d], shapes[3][$d + 1], f[3];
    const ${p}_real *c = s->carry;
    ${p}_real h, passed, y, aim;
    int part, i, n, j, k;
    if (!(dt > 0 && ${p}_usable(dt) && du >= 0 && du <= 1))
        return 0;
    s->time += (double)dt;
    for (k = 0; k < ${p}_dims; k++) {
        pace[k] = du > (${p}_real)1e-30 ? s->drift[k] / rate : 0;
        ahead[k] = s->goal[k] + ${p}_D / ${p}_K * pace[k]; /* a goal that moves is followed without a lag */
        s->goal[k] += dt * s->drift[k];
        x[k] = s->position[k] - ahead[k];
        v[k] = s->pace[k] - pace[k];
        force[k] = 0;
    }
    if (!(du > (${p}_real)1e-30)) {
        s->rate = 0;
        for (k = 0; k < ${p}_dims; k++)
            s->velocity[k] = s->acceleration[k] = 0;
        return 1;
    }
    for (k = 0; k <= ${p}_dims; k++)
        shapes[2][k] = s->shape[k];
    for (part = 0, passed = 0; part < 2; part++) {
        h = part ? du - to_end : to_end;
        n = h > 0 ? (int)(h * ${p}_intervals) + 1 : 0;
        h = n > 0 ? h / n : 0;
        if (n > 0 && h != s->h)
            ${p}_prepare(s, h);
        for (i = 0; i < n; i++, passed += h) {
            for (k = 0; k <= ${p}_dims; k++)
                shapes[0][k] = shapes[2][k];
            ${p}_shape(begin + passed + h / 2, shapes[1]);
            ${p}_shape(begin + passed + h, shapes[2]);
            for (k = 0; k < ${p}_dims; k++) {
                for (j = 0; j < 3; j++) {
                    aim = ahead[k] - s->start[k] + (passed + j * h / 2) * pace[k];
                    f[j] = shapes[j][k] * s->ratio[k] + shapes[j][${p}_dims] * aim - ${p}_D * pace[k];
                }
                y = x[k];
                x[k] = c[0] * y + c[1] * v[k] + h / 6 * (c[1] * f[0] + 4 * c[4] * f[1]);
                v[k] = c[2] * y + c[3] * v[k] + h / 6 * (c[3] * f[0] + 4 * c[5] * f[1] + f[2]);
                force[k] = f[2];
            }
        }
    }
    for (k = 0; k < ${p}_dims; k++)
        if (!${p}_usable(x[k]) || !${p}_usable(v[k]))
            return 0;
    s->u += (double)du;
    s->rate = rate;
    for (k = 0; k <= ${p}_dims; k++)
        s->shape[k] = shapes[2][k];
    for (k = 0; k < ${p}_dims; k++) {
        s->position[k] = x[k] + ahead[k] + du * pace[k];
        s->pace[k] = v[k] + pace[k];
        s->velocity[k] = rate * s->pace[k];
        s->acceleration[k] = rate * rate * (force[k] - ${p}_K * x[k] - ${p}_D * v[k]);
    }
    return 1;
}

#endif
"""


def c_header(primitive: Primitives, name: str = "movement") -> str:
    """A primitive as one C header (C99, C++11): tables, a state, and functions that start, aim and step it.

    The steps are those of the controller without options, to 1e-5 of the extent, with goals that move and any tempo:
    the spring is carried exactly, what drives it enters by Simpson's rule, of order 4. Includes <math.h> and
    <stddef.h>, allocates nothing.

    Parameters
    ----------
    primitive : Primitives
        One primitive. Columns that are discrete, as a gripper that is open or closed, are not in it.
    name : str, default "movement"
        What the names in the header begin with; characters that C does not allow become underscores.

    Raises
    ------
    SpecificationError
        Several primitives, or one of orientations or of a rhythm; a spring so stiff that a step would not end.

    Examples
    --------
    >>> import kineme
    >>> from kineme.dmp import c_header
    >>> primitives = kineme.DMP().learn(kineme.load_lasa(["CShape"]))
    >>> "c_shape_step(" in c_header(primitives[0], "c-shape")
    True
    """
    check_exported(primitive)
    dmp, p = primitive.dmp, c_name(name)
    fastest = max(math.sqrt(dmp.K), 0.5 * dmp.D, dmp.basis.phase.alpha)
    if not (intervals := max(_PER_GAP * (dmp.n_basis - 1), _PER_TIME_CONSTANT * fastest)) <= _MOST_INTERVALS:
        raise SpecificationError(
            f"expected a spring and a phase that {_MOST_INTERVALS:g} intervals in a duration can follow, got stiffness "
            f"{dmp.K:g}, damping {dmp.D:g} and phase_end {dmp.phase_end:g}; learn with a softer spring, a later phase"
        )
    a, extent = 0.5 * dmp.D, float(primitive.extents.max())
    square = dmp.K - a * a
    b = math.sqrt(abs(square))
    side = 0 if abs(square) <= _CRITICAL * dmp.K else int(math.copysign(1, square))
    learned = primitive.goals[0] - primitive.starts[0]
    distance = float(np.linalg.norm(learned))
    text = Template(_HEADER).safe_substitute(
        coupling=_COUPLINGS[dmp.formulation],
        gate=_GATES[dmp.gating],
        transition=_TRANSITIONS[side],
        ratio=_RATIOS.get(dmp.formulation, ""),
        sum=", sum = 0" if dmp.formulation == "amplitude-scaled" else "",
    )
    tables: dict[str, tuple[Any, str]] = {
        "weights": (primitive.scaled_weights[0].T, "by function and dimension, times the scale of f"),
        "centers": (dmp.basis.centers, "c_i"),
        "widths": (np.sqrt(dmp.basis.widths), "square roots of h_i"),
        "x0": (primitive.starts[0], "start"),
        "g": (primitive.goals[0], "goal"),
        "v0": (primitive.velocities[0] * primitive.durations[0], "velocity at the start, per duration"),
        "tau": (primitive.durations[0], "duration [s]"),
        "K": (dmp.K, "stiffness"),
        "D": (dmp.D, "damping"),
        "a": (a, "D / 2"),
        "b": (b, "sqrt(|K - D * D / 4|)"),
        "slow": (dmp.K / (a + b), "rate of the slow pole"),
        "alpha": (dmp.basis.phase.alpha, "of the phase s = exp(-alpha u)"),
        "end": (dmp.basis.phase.end, "phase at u = 1"),
        "late": (HANDOVER**3, "cube of the phase at which shape and goal weigh the same"),
        "learned": (np.where(np.abs(learned) <= ZERO * extent, 0.0, learned), "goal - start, 0 where that is rounding"),
        "nothing": (ZERO * extent, "of goal - start: rounding"),
        "distance": (distance * (distance > CLOSED * extent), "from start to goal; 0 if the movement is closed"),
        "intervals": (intervals, "in a duration, at least"),
    }
    largest = max(np.abs(values).max() for values, _ in tables.values())
    used = {key: table for key, table in tables.items() if re.search(rf"\{{p\}}_{key}\b", text)}
    written = "".join(_c_table(p, key, *table) for key, table in used.items())
    return Template(text).substitute(
        p=p,
        single='#error "numbers of this movement need double precision"\n' if largest > _LARGEST_SINGLE else "",
        # Of two movements with one prefix, a compiler refuses the second, and does not skip it.
        guard=f"{p.upper()}_{sha256((text + written).encode()).hexdigest()[:8].upper()}",
        d=primitive.n_dims,
        n=dmp.n_basis,
        formulation=dmp.formulation,
        fit=dmp.fit,
        stiffness=f"{dmp.K:g}",
        gating=dmp.gating,
        columns=", ".join(
            re.sub(r"[^\w .()\[\]-]", "_", column, flags=re.ASCII) for column in exported_columns(primitive)
        ),
        tables=written,
    )


def c_name(name: str) -> str:
    """Return what the identifiers of a header begin with, before suffixes: letters, digits, single underscores."""
    words = re.sub("[^a-z0-9]+", "_", name.lower()).strip("_")[:_LONGEST_NAME].strip("_")
    return words if words[:1].isalpha() else f"movement_{words}".strip("_")


def check_exported(primitive: Primitives) -> None:
    """Refuse several primitives, and others than discrete ones of positions and angles."""
    if not isinstance(primitive, Primitives) or (primitive.recorded_as and primitive.recorded_as.orientations):
        raise SpecificationError(
            f"expected a discrete primitive of positions or angles to export, got {type(primitive).__name__}"
            f"{' of an orientation' * isinstance(primitive, Primitives)}; orientations and rhythms run in Python, by "
            "their controller"
        )
    if len(primitive) != 1:
        raise SpecificationError(
            f"expected one primitive to export, got {len(primitive)}; choose one, as primitives[0]"
        )


def exported_columns(primitive: Primitives) -> list[str]:
    """Names of the columns of a primitive."""
    about = primitive.recorded_as
    return primitive.plain_names[0] if about is None else list(about.column_names)


def _c_table(prefix: str, name: str, numbers: Any, meaning: str) -> str:
    """Numbers as a constant of C, in digits that read back exactly."""
    values = np.asarray(numbers)
    shape = "".join(f"[{n}]" for n in values.shape)
    rows = [", ".join(map(repr, row)) for row in np.atleast_2d(values).tolist()]
    if values.ndim < 2:
        text = rows[0] if values.ndim == 0 else textwrap.fill(f"{{{rows[0]}}}", _WIDTH, subsequent_indent="    ")
    else:
        text = "{\n    " + ",\n    ".join(f"{{{row}}}" for row in rows) + "\n}"
    return f"static const {prefix}_real {prefix}_{name}{shape} = {text}; /* {meaning} */\n"
