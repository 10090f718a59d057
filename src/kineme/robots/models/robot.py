"""An arm: its joints, their limits, its kinematics and its shape."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import DataError, SpecificationError
from kineme.robots.models.rest import rest_posture
from kineme.robots.models.table import MODELS, Model
from kineme.robots.models.urdf import Chain, read_chain
from kineme.validation import Array, as_numbers, check_number

_FOLDER = Path(__file__).parent
_ACCELERATION = 5.0  # of joints whose file says none [rad/s^2 or m/s^2]
_ROUNDING = 1e-6  # so far outside a limit a joint still counts as at it [rad, m]
_VELOCITY = 1.0  # the same for velocities


@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """An arm, made by `load`. Arrays have one entry for each of its n joints between the root and the tip.

    Attributes
    ----------
    name : str
    joints : tuple of str
    units : tuple of str
        "rad", or "m" of joints that slide.
    tip : str
        The frame that follows the movement.
    lower, upper : ndarray of shape (n,)
        Limits of position [rad, m].
    velocity, acceleration : ndarray of shape (n,)
        Limits, per second and per second squared.
    effort : ndarray of shape (n,)
        Largest torque or force; nan where it is not known.
    rest : ndarray of shape (n,)
        The posture from which movements are approached.
    assumed : tuple of str
        What the file does not say and what is taken instead, one sentence each.
    source : Path
        The URDF file.
    model, geometry : pinocchio.Model, pinocchio.GeometryModel
        Of these joints alone; all others are locked.
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

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.joints)

    def __repr__(self) -> str:
        return f"Robot({self.name!r}: {self.n_joints} joints, tip {self.tip!r})"


def check_robot(robot: object) -> None:
    """Refuse what is not an arm.

    Raises
    ------
    SpecificationError
        Something else than a `Robot`, as its name.
    """
    if not isinstance(robot, Robot):
        raise SpecificationError(f"expected a robot, as of kineme.robots.load('panda'), got {robot!r:.80}")


def check_start(robot: Robot, q: Array) -> None:
    """Refuse joint positions (n,) outside the limits, where a movement is to start.

    Raises
    ------
    SpecificationError
        The first such joint, with its limits.
    """
    inside = (q >= robot.lower - _ROUNDING) & (q <= robot.upper + _ROUNDING)
    if not inside.all():
        i = int(np.argmin(inside))
        raise SpecificationError(
            f"expected {robot.joints[i]} to start within [{robot.lower[i]:.4g}, {robot.upper[i]:.4g}], got {q[i]:.4g}"
        )


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
        "panda", "ur5e", "wam", "so101", or the path of a URDF file. A path ends in ``.urdf`` or ``.xml``.
    tip : str, optional
        The link that follows the movement; by default that of the model, of a file the end of its only chain.
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
    pinocchio = _pinocchio()
    path, default_tip, default_rest, name = _find(robot, tip)
    chain = read_chain(path, tip or default_tip)
    model, geometry = _build(pinocchio, path, chain)
    lower, upper, velocity, acceleration, effort = (np.array(column) for column in zip(*chain.limits, strict=True))
    assumed = _assumed(chain, MODELS.get(name) if path.parent == _FOLDER else None)
    assumed += _limit("velocity", velocity, max_velocity, _VELOCITY, "1/s", chain)
    assumed += _limit("acceleration", acceleration, max_acceleration, _ACCELERATION, "1/s^2", chain)
    posture = default_rest if rest is None and tip in (None, default_tip) else rest
    if posture is None:
        at_rest, bent = rest_posture(model, chain.tip, lower, upper)
        assumed += [_bent_in_words(at_rest)] if bent else []
    else:
        at_rest = _posture(posture, lower, upper, chain.joints)
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
    )


def _assumed(chain: Chain, known: Model | None) -> list[str]:
    """What is said about a model that comes with kineme, and about joints and links of which a file says too little."""
    assumed = [known.assumed] if known is not None and known.assumed else []
    if chain.without_stops:
        assumed.append(f"{_have(chain.without_stops)} no stops: it is kept within one turn to each side")
    if chain.without_shape:
        assumed.append(f"{_have(chain.without_shape)} no shape: its mesh is not there")
    return assumed


def _limit(what: str, values: Array, largest: float | None, default: float, unit: str, chain: Chain) -> list[str]:
    """Put the default where the file says no limit, and nothing above `largest`, in place; what was assumed."""
    unknown = np.isnan(values)
    if largest is None:
        named = ", ".join(np.array(chain.joints)[unknown])
        values[unknown] = default
        return [f"the file says no {what} limit for {named}: {default:g} {unit} is taken"] if unknown.any() else []
    check_number(f"max_{what}", largest, above=0.0)
    values[unknown] = largest
    np.minimum(values, largest, out=values)
    return []


def _have(names: tuple[str, ...]) -> str:
    """Up to three names, and that each has what follows."""
    named = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
    return f"{named} {'each have' if len(names) > 1 else 'has'}"


def _bent_in_words(rest: Array) -> str:
    posture = ",".join(f"{value:.4g}" for value in rest)
    return f"in the middle of its limits the arm is singular: it rests at {posture} (choose with rest=, --rest)"


def _pinocchio() -> Any:
    try:
        import pinocchio
    except ImportError as error:
        raise DataError("expected the package pin for arms; pip install 'kineme[robot]'") from error
    return pinocchio


def _find(robot: str | Path, tip: str | None) -> tuple[Path, str | None, ArrayLike | None, str]:
    if not isinstance(tip, str | None):
        raise SpecificationError(f"expected tip as the name of a link, got {tip!r:.80}")
    if not isinstance(robot, str | os.PathLike):
        raise SpecificationError(f"expected the name of a robot or the path of a .urdf file, got {robot!r:.80}")
    text = os.fspath(robot)
    if text in MODELS:
        return _FOLDER / f"{text}.urdf", MODELS[text].tip, MODELS[text].rest, text
    path = Path(text)
    if path.suffix.lower() not in (".urdf", ".xml"):
        raise SpecificationError(f"expected one of {', '.join(MODELS)} or the path of a .urdf file, got {text!r}")
    return path, None, None, path.stem


def _build(pinocchio: Any, path: Path, chain: Chain) -> tuple[Any, Any]:
    """The reduced model of the chain's joints, and the geometry of those links whose shapes can be had."""
    try:
        whole = pinocchio.buildModelFromXML(chain.text)
        shapes = pinocchio.buildGeomFromUrdfString(whole, chain.text, pinocchio.GeometryType.COLLISION, package_dirs=[])
        locked = [whole.getJointId(name) for name in list(whole.names)[1:] if name not in chain.joints]
        model, geometry = pinocchio.buildReducedModel(whole, shapes, locked, pinocchio.neutral(whole))
    except (ValueError, RuntimeError) as error:
        raise DataError(f"{path}: pinocchio cannot read this URDF: {error}") from error
    order = [str(name) for name in list(model.names)[1:]]
    if order != list(chain.joints):
        raise DataError(f"{path}: expected the joints in the order {list(chain.joints)}, got {order}")
    return model, geometry


def _posture(rest: ArrayLike, lower: Array, upper: Array, joints: tuple[str, ...]) -> Array:
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
