"""An arm: its joints, their limits, its kinematics and its shape."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass
from itertools import combinations, product
from math import pi
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import DataError, SpecificationError
from kineme.reporting.text import first_names
from kineme.robots.models.urdf import LISTED, Candidate, Chain, read_chain
from kineme.validation import Array, as_numbers, check_number

#: Where their URDF files lie.
FOLDER = Path(__file__).parent


class Model(NamedTuple):
    """An arm whose URDF file lies beside this module."""

    title: str
    tip: str  # the frame that follows the movement
    rest: tuple[float, ...]  # joint positions from which it starts, tool pointing down where it can [rad]
    assumed: str = ""  # what its maker does not publish, and what is taken instead
    meshes: str = ""  # its URDF with meshes in the package example-robot-data, if installed


#: Name -> model; ``robots.load``, the command line and the docs list what is here.
MODELS = {
    "panda": Model(
        "Franka Emika Panda, 7 joints",
        "panda_hand_tcp",
        (0.0, -pi / 4, 0.0, -3 * pi / 4, 0.0, pi / 2, pi / 4),
        meshes="panda_description/urdf/panda.urdf",
    ),
    "ur5e": Model("Universal Robots UR5e, 6 joints", "tool0", (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)),
    "wam": Model(
        "Barrett WAM, 7 joints",
        "wam_tool",
        (0.0, 0.6, 0.0, 1.8, 0.0, 0.75, 0.0),
        "its maker publishes no limits of velocity: 2 rad/s is taken for every joint, measure yours",
    ),
    "so101": Model(
        "SO-101, 5 joints",
        "gripper_frame_link",
        (0.0, -0.6, 0.9, 0.9, 0.0),
        meshes="so_arm_description/urdf/so101.urdf",
    ),
}

_BEND = pi / 3  # of a joint that is bent [rad]
_MOST_BENT = 3  # joints
_FREE = 0.05  # the smallest singular value of the Jacobian from which on a posture is good to start from
_ALIKE = 6  # digits to which two postures are as good as each other

_ACCELERATION = 5.0  # of joints whose file says none [rad/s^2 or m/s^2]
_VELOCITY = 1.0  # the same for velocities


def load(
    robot: str | Path,
    tip: str | None = None,
    rest: ArrayLike | None = None,
    max_velocity: float | None = None,
    max_acceleration: float | None = None,
) -> Robot:
    """An arm by name or from a URDF file.

    Parameters
    ----------
    robot : str or Path
        "panda", "ur5e", "wam", "so101", or the path of a URDF file. A path ends in ``.urdf`` or ``.xml``; one in
        ``.xacro`` is converted where the package ``xacro`` is installed.
    tip : str, optional
        The link that follows the movement; by default that of the model, of a file the end of its longest chain: by
        its name (``tcp``, ``tool0``, ``ee`` ...), else the last link. Joints of grippers and hands are locked.
    rest : array_like of shape (n,), optional
        Posture from which movements are approached; by default that of the model, of a file the middle of the limits
        (0 of joints that turn several times), with up to three joints bent if that is a singular posture.
    max_velocity, max_acceleration : float, optional
        Upper bounds for all joints, below what the file allows; also of joints whose file says none, which otherwise
        get 1 per second and 5 per second squared.

    Raises
    ------
    DataError
        The extra ``robot`` is not installed, no such file, or a file that is not a usable URDF.
    SpecificationError
        An unknown name; a rest posture of another number of joints or outside the limits.
    """
    try:
        import pinocchio
    except ImportError as error:
        raise DataError("expected the package pin for arms; pip install 'kineme[robot]'") from error
    path, default_tip, default_rest, name = _find(robot, tip)
    chain = read_chain(path, tip or default_tip)
    model, geometry, locked = _build(pinocchio, path, chain)
    lower, upper, velocity, acceleration, effort = (np.array(column) for column in zip(*chain.limits, strict=True))
    assumed = [MODELS[name].assumed] if name in MODELS and path.parent == FOLDER and MODELS[name].assumed else []
    assumed += _assumptions(chain)
    assumed += _limit("velocity", velocity, max_velocity, _VELOCITY, "1/s", chain)
    assumed += _limit("acceleration", acceleration, max_acceleration, _ACCELERATION, "1/s^2", chain)
    posture = default_rest if rest is None and tip in (None, default_tip) else rest
    if posture is None:
        at_rest, bent = rest_posture(model, chain.tip, lower, upper)
        if bent:
            words = ",".join(f"{value:.4g}" for value in at_rest)
            assumed.append(
                f"in the middle of its limits the arm is singular: it rests at {words} (choose with rest=, --rest)"
            )
    else:
        at_rest = checked_rest(posture, lower, upper, chain.joints)
    return Robot(
        name,
        chain.joints,
        chain.units,
        chain.tip,
        lower,
        upper,
        velocity,
        acceleration,
        effort,
        at_rest,
        tuple(assumed),
        path,
        model,
        geometry,
        locked,
    )


def _find(robot: str | Path, tip: str | None) -> tuple[Path, str | None, ArrayLike | None, str]:
    if not isinstance(tip, str | None):
        raise SpecificationError(f"expected tip as the name of a link, got {tip!r:.80}")
    if not isinstance(robot, str | os.PathLike):
        raise SpecificationError(f"expected the name of a robot or the path of a .urdf file, got {robot!r:.80}")
    text = os.fspath(robot)
    if text in MODELS:
        return FOLDER / f"{text}.urdf", MODELS[text].tip, MODELS[text].rest, text
    path = Path(text)
    if path.suffix.lower() not in (".urdf", ".xml", ".xacro"):
        raise SpecificationError(f"expected one of {', '.join(MODELS)} or the path of a .urdf file, got {text!r}")
    return path, None, None, path.stem


def _build(pinocchio: Any, path: Path, chain: Chain) -> tuple[Any, Any, tuple[str, ...]]:
    """Build the reduced model of the chain's joints and the geometry of links whose shapes can be had; name others."""
    try:
        full = pinocchio.buildModelFromXML(chain.text)
        shapes = pinocchio.buildGeomFromUrdfString(full, chain.text, pinocchio.GeometryType.COLLISION, package_dirs=[])
        locked = tuple(str(name) for name in list(full.names)[1:] if name not in chain.joints)
        _check_read(chain.text, full, shapes, path)
        still = np.clip(pinocchio.neutral(full), full.lowerPositionLimit, full.upperPositionLimit)
        model, geometry = pinocchio.buildReducedModel(full, shapes, list(map(full.getJointId, locked)), still)
    except (ValueError, RuntimeError) as error:
        raise DataError(f"{path}: pinocchio cannot read this URDF: {error}") from error
    order = [str(name) for name in list(model.names)[1:]]
    if order != list(chain.joints):
        raise DataError(f"{path}: expected the joints in the order {list(chain.joints)}, got {order}")
    return model, geometry, locked


def _check_read(text: str, model: Any, shapes: Any, path: Path) -> None:
    """Refuse a model with other numbers of collision shapes, or other masses that move, than its XML says."""
    frames = {str(frame.name): frame.parentJoint for frame in model.frames if frame.type.name == "BODY"}
    n_read = Counter(str(model.frames[shape.parentFrame].name) for shape in shapes.geometryObjects)
    masses = np.zeros(model.njoints)
    for link in ElementTree.fromstring(text).findall("link"):
        name, mass, expected = str(link.get("name")), link.find("inertial/mass"), len(link.findall("collision"))
        masses[frames[name]] += 0.0 if mass is None else float(mass.get("value", "0"))
        if expected != n_read[name]:
            raise DataError(
                f"{path}: link {name!r}: expected {expected} collision shapes, but {n_read[name]} can be read"
            )
    read = np.array([inertia.mass for inertia in model.inertias])
    wrong = ~np.isclose(masses, read)
    wrong[0] = False  # what does not move
    if wrong.any():
        i = int(np.argmax(wrong))
        raise DataError(
            f"{path}: joint {str(model.names[i])!r}: expected it to move links of {masses[i]:g} kg together, but "
            f"{read[i]:g} kg can be read"
        )


def _limit(what: str, values: Array, largest: float | None, default: float, unit: str, chain: Chain) -> list[str]:
    """Put the default where the file says no limit, and nothing above `largest`, in place; return what was assumed."""
    unknown = np.isnan(values)
    if largest is None:
        named = ", ".join(np.array(chain.joints)[unknown])
        values[unknown] = default
        return [f"the file says no {what} limit for {named}: {default:g} {unit} is taken"] if unknown.any() else []
    check_number(f"max_{what}", largest, above=0.0)
    values[unknown] = largest
    np.minimum(values, largest, out=values)
    return []


def _assumptions(chain: Chain) -> list[str]:
    """Describe assumptions about joints and links of which a file says too little."""
    assumed = []
    if chain.others:
        assumed.append(
            f"the tip is {Candidate(chain.tip, len(chain.joints))}, of the longest chain; others are "
            f"{first_names(chain.others, LISTED)} (choose with tip=, --tip)"
        )
    if chain.gripper:
        belong = "belong" if len(chain.gripper) > 1 else "belongs"
        assumed.append(f"{first_names(chain.gripper, 3)} {belong} to a gripper or a hand: locked, no part of the arm")
    assumed += chain.doubts
    if chain.without_stops:
        are = "they are" if len(chain.without_stops) > 1 else "it is"
        assumed.append(f"{_have(chain.without_stops)} no stops: {are} kept within one turn to each side")
    if chain.without_shape:
        assumed.append(f"{_have(chain.without_shape)} no shape: its mesh is not there")
    return assumed


def _have(names: tuple[str, ...]) -> str:
    """Write up to three names, and that each has what follows."""
    return f"{first_names(names, 3)} {'each have' if len(names) > 1 else 'has'}"


def checked_rest(rest: ArrayLike, lower: Array, upper: Array, joints: tuple[str, ...]) -> Array:
    """Check a rest posture (n,) that is given."""
    posture = as_numbers(rest, "rest")
    if posture.shape != lower.shape:
        raise SpecificationError(f"expected a rest posture of {len(joints)} joints, got shape {posture.shape}")
    outside = ~((posture >= lower) & (posture <= upper))
    if outside.any():
        i = int(np.argmax(outside))
        raise SpecificationError(
            f"rest posture: expected {joints[i]} within [{lower[i]:.4g}, {upper[i]:.4g}], got {posture[i]:.4g}"
        )
    return posture


def rest_posture(model: Any, tip: str, lower: Array, upper: Array) -> tuple[Array, bool]:
    """Return the middle of the limits (n,), and where it is singular, as of a straight arm, with joints bent: True.

    Of the postures with up to three joints turned by 60 degrees, within the limits and no link lower than in the middle
    or than the base, that whose Jacobian has the largest smallest singular value.
    """
    wide = upper - lower > 2 * pi + 1e-9
    middle = np.where(wide, np.clip(0.0, lower, upper), (lower + upper) / 2)
    best, lowest = _manipulability(model, tip, middle)
    if best >= _FREE:
        return middle, False
    floor, chosen = min(0.0, lowest), middle
    bends = (
        (list(joints), _BEND * np.array(signs))
        for count in range(1, _MOST_BENT + 1)
        for joints in combinations(range(len(middle)), count)
        for signs in product((1.0, -1.0), repeat=count)
    )
    for joints, angles in bends:
        q = middle.copy()
        q[joints] += angles
        if np.all((q >= lower) & (q <= upper)):
            value, lowest = _manipulability(model, tip, q)
            if lowest >= floor - 1e-6 and round(value, _ALIKE) > round(best, _ALIKE):
                best, chosen = value, q
    return np.asarray(chosen, dtype=np.float64), chosen is not middle


def _manipulability(model: Any, tip: str, q: Array) -> tuple[float, float]:
    """Return the smallest singular value of the Jacobian of the tip, and the height of the lowest joint or tip [m]."""
    import pinocchio

    data = model.createData()
    frame = model.getFrameId(tip)
    pinocchio.computeJointJacobians(model, data, q)
    pinocchio.updateFramePlacement(model, data, frame)
    jacobian = pinocchio.getFrameJacobian(model, data, frame, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    heights = [data.oMf[frame].translation[2], *(data.oMi[j].translation[2] for j in range(1, model.njoints))]
    return float(np.linalg.svd(jacobian.reshape(6, -1), compute_uv=False)[min(6, len(q)) - 1]), float(min(heights))


_ROUNDING = 1e-6  # so far outside a limit a joint still counts as at it [rad, m]


@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """An arm, made by `load`. Arrays have one entry for each of its n joints between the root and the tip.

    - `units`: "rad", or "m" of joints that slide.
    - `tip`: the frame that follows the movement.
    - `lower`, `upper` (n,): limits of position [rad, m].
    - `velocity`, `acceleration` (n,): limits, per second and per second squared.
    - `effort` (n,): largest torque or force; nan where it is not known.
    - `rest` (n,): the posture from which movements are approached.
    - `assumed`: what the file does not say and what is taken instead, one sentence each.
    - `source`: the URDF file.
    - `model`, `geometry`: of these joints alone; all others are locked.
    - `locked`: names of the other joints that the file says to move.
    """

    name: str
    joints: tuple[str, ...]
    units: tuple[str, ...]
    tip: str
    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    effort: Array
    rest: Array
    assumed: tuple[str, ...]
    source: Path
    model: Any
    geometry: Any
    locked: tuple[str, ...] = ()

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.joints)

    def __repr__(self) -> str:
        return f"Robot({self.name!r}: {self.n_joints} joints, tip {self.tip!r})"


def check_robot(robot: object) -> None:
    """Refuse what is not an arm, as its name."""
    if not isinstance(robot, Robot):
        raise SpecificationError(f"expected a robot, as of kineme.robots.load('panda'), got {robot!r:.80}")


def check_start(robot: Robot, q: Array) -> None:
    """Refuse joint positions (n,) outside the limits, where a movement is to start."""
    inside = (q >= robot.lower - _ROUNDING) & (q <= robot.upper + _ROUNDING)
    if not inside.all():
        i = int(np.argmin(inside))
        raise SpecificationError(
            f"expected {robot.joints[i]} to start within [{robot.lower[i]:.4g}, {robot.upper[i]:.4g}], got {q[i]:.4g}"
        )
