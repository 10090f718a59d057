"""A primitive as an ONNX model: its decode matrix, from weights, starts and goals to movements."""

from __future__ import annotations

import json

import numpy as np

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.discrete.operators import decoder
from kineme.dmp.discrete.specification import CLOSED, ZERO
from kineme.dmp.export_c import check_exported, exported_columns
from kineme.errors import SpecificationError
from kineme.io.records import needs

#: What f is multiplied by for a new amplitude g - x0, where the formulation says so.
_RATIOS = {
    "original": "ratio = Div(amplitude, learned)",
    "amplitude-scaled": "size = ReduceL2 <axes = [-1], keepdims = 1> (amplitude)\n    ratio = Div(size, learned)",
}

# ONNX 1.12: what reads later versions reads this one. Products with rows of T numbers are broadcast over movements.
_MODEL = """\
<ir_version: 8, opset_import: ["" : 17], producer_name: "kineme">
decode ({kind}[n, {d}] start, {kind}[n, {d}] goal, {kind}[weighted, {d}, {N}] weights, {kind}[moving, {d}] velocity)
    => ({kind}[movements, {T}, {d}] positions, {kind}[movements, {T}, {d}] velocities) {{
    amplitude = Sub(goal, start)
    {ratio}
    ratios = Unsqueeze(ratio, last)
    scaled = Mul(weights, ratios)
    amplitudes = Unsqueeze(amplitude, last)
    initial = Unsqueeze(velocity, last)
    starts = Unsqueeze(start, last)
    numbers_0 = MatMul(scaled, Phi_0)
    toward_0 = Mul(amplitudes, goal_0)
    begun_0 = Mul(initial, velocity_0)
    path_0 = Sum(numbers_0, toward_0, begun_0, starts)
    numbers_1 = MatMul(scaled, Phi_1)
    toward_1 = Mul(amplitudes, goal_1)
    begun_1 = Mul(initial, velocity_1)
    path_1 = Sum(numbers_1, toward_1, begun_1)
    positions = Transpose <perm = [0, 2, 1]> (path_0)
    velocities = Transpose <perm = [0, 2, 1]> (path_1)
}}
"""


def onnx_model(primitive: Primitives, *, double: bool = False) -> bytes:
    """A primitive as an ONNX model (opset 17, IR 8) that decodes movements, in one product, for any number of goals.

    Inputs are `start` and `goal` (n, d), and with defaults, which are those of the primitive, `weights` (n, d, N), its
    `scaled_weights`, and `velocity` (n, d) at the start, per duration; each may be of one movement for all. Outputs are
    `positions` and `velocities` (n, T, d), the latter per duration, at the T = `n_points` even times of the
    specification: those of ``primitive.rollout(start, goal)``. Start, goal, duration [s] and columns of the
    demonstration are in the metadata of the model, as JSON.

    Parameters
    ----------
    primitive : Primitives
        One primitive; it gives the specification, the defaults, and the amplitude that new ones are compared with.
    double : bool, default False
        Numbers of 64 bits instead of 32, which not every runtime takes.

    Raises
    ------
    DataError
        The package onnx is not installed.
    SpecificationError
        Several primitives, or one of orientations or of a rhythm; the original formulation where a dimension ends at
        its start.
    """
    check_exported(primitive)
    with needs("onnx", "write ONNX models", "onnx"):
        from onnx import checker, helper, numpy_helper, parser
    dmp, learned = primitive.dmp, primitive.goals - primitive.starts
    response, nothing = decoder(dmp, dmp.n_points), ZERO * primitive.extents.max()
    if dmp.system.divides_by_amplitude and (np.abs(learned) <= nothing).any():
        raise SpecificationError(
            "expected a movement that ends elsewhere than it starts in every dimension, which the original "
            'formulation divides by; learn with the "bio-inspired" one, or write a C header'
        )
    ratio = _RATIOS.get(dmp.formulation)
    if dmp.formulation == "amplitude-scaled":
        learned = np.linalg.norm(learned, axis=1, keepdims=True)
        ratio = ratio if learned.item() > CLOSED * primitive.extents.max() else None
    number = np.float64 if double else np.float32
    text = _MODEL.format(
        kind="double" if double else "float",
        d=primitive.n_dims,
        N=dmp.n_basis,
        T=dmp.n_points,
        ratio=ratio or "ratio = Identity(learned)",
    )
    model = parser.parse_model(text)
    constants = {"weights": primitive.scaled_weights, "velocity": primitive.velocities * primitive.durations[:, None]}
    constants["learned"] = learned if ratio else np.ones((1, 1))
    for order in (0, 1):
        constants |= {
            f"Phi_{order}": response.Phi[order].T,
            f"goal_{order}": response.goal[order],
            f"velocity_{order}": response.velocity[order],
        }
    tensors = [numpy_helper.from_array(values.astype(number), name) for name, values in constants.items()]
    model.graph.initializer.extend([*tensors, numpy_helper.from_array(np.array([-1]), "last")])
    about = {"start": primitive.starts[0], "goal": primitive.goals[0], "duration": primitive.durations[0]}
    metadata = {name: json.dumps(value.tolist()) for name, value in about.items()}
    helper.set_model_props(model, metadata | {"columns": json.dumps(exported_columns(primitive))})
    checker.check_model(model)
    return bytes(model.SerializeToString())
