"""Arms that execute movements, and what is checked before."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter
from fastapi import Path as InPath
from fastapi.responses import Response
from pydantic import BaseModel, Field

from kineme.dmp.generation.generate import Learned
from kineme.errors import KinemeError, SpecificationError
from kineme.io.writing.write_movement import WRITERS
from kineme.robots.execution.preflight import Preflight, checks_as_data, preflight_table
from kineme.robots.export_files import not_in_goal, write_action_goal, write_bag, write_joints
from kineme.robots.kinematics.descent import InverseKinematics, descend
from kineme.robots.models.robot import MODELS, Robot, load
from kineme.robots.planning.generate_at import generate_at
from kineme.robots.planning.move import move as move_arm
from kineme.robots.planning.robot_movement import InfeasibleError, RobotMovement
from kineme.robots.planning.roles import roles_of, space_of
from kineme.robots.view.write_view import posture_data, scene_data, shapes_of
from kineme.studio.server.records import Number, Point, RequestBody, Text, numbers
from kineme.studio.server.refusals import in_studio_words
from kineme.studio.server.rollout_routes import PrimitiveRequest, as_file, learned_as, name_of
from kineme.studio.server.studio import Reads, Studio
from kineme.validation import Array

_ROS = {".yaml": write_action_goal, ".mcap": write_bag, ".bag": write_bag}  # beside the writers of tables
ArmName = Annotated[str, InPath(max_length=200, description="Name of an arm, as in `/api/robots`.")]
_AS_SHOWN = 0.01  # of a component of a quaternion
_STEPS = 6  # towards the hand, from where the arm stands
_REACH = 0.4  # of the distance of the tip at rest: half of the square that the hand moves in


class ArmsOut(BaseModel):
    """Arms that can be asked for."""

    available: bool
    why: str | None
    robots: list[str]


class MoveRequest(PrimitiveRequest):
    """A movement for an arm; `size` is its largest extent there [m], `at` and `goal` are in the frame of the robot.

    Of a movement of joints, `at` and `goal` are in the units and the order of their columns.

    Instead of a goal, `displacement` is the way from start to goal in the unit of the library: of the positions, or of
    all columns that move, as `/api/rollout` says start and goal.
    """

    robot: Text
    at: Point | None = None
    goal: Point | None = None
    displacement: Point | None = None
    duration: Number | None = Field(None, gt=0)
    size: Number | None = Field(None, gt=0)
    plane: Literal["xy", "xz", "yz"] | None = Field(None, description="By default as the columns say, else xy.")
    slow_down: bool = False
    shapes: bool = Field(True, description="Whether the scene has the shapes of the arm, with meshes many megabytes.")


class CheckOut(BaseModel):
    """The worst instant of one quantity beside its limit."""

    what: str
    where: str
    worst: float | None
    limit: float | None
    unit: str
    time: float | None
    passed: bool


class JointOut(BaseModel):
    """A joint and its limits."""

    name: str
    low: float | None
    high: float | None


class MoveOut(BaseModel):
    """The answer to a movement for an arm: its joints and checks, or why it must not move; `scene` draws it."""

    passed: bool
    refusal: str | None
    checks: list[CheckOut]
    table: list[list[str]] = Field(description="The checks in words: check, worst, limit, unit, at [s], result.")
    unchecked: list[str]
    assumed: list[str]
    joints: list[JointOut]
    scene: dict[str, Any] | None


class SaveRequest(MoveRequest):
    """The same as a file of the joints."""

    format: Text = Field(description=f"One of {', '.join([*WRITERS, *_ROS])}.")


class FollowRequest(RequestBody):
    """Where a hand is, across and up from -1 to 1, and where the joints stand; without them the arm stands at rest."""

    robot: Text
    hand: list[Number] = Field(min_length=2, max_length=2)
    joints: Point | None = None


class FollowOut(BaseModel):
    """Joints whose tip is where the hand is, and its distance from there [m]: more than 0 out of reach."""

    joints: list[float]
    distance: float


router = APIRouter(prefix="/api/robots", tags=["robots"])


@router.get("", response_model=ArmsOut, summary="Which arms there are")
def robots(studio: Reads) -> dict[str, Any]:
    """Those that come with kineme; without the extra `robot`, why there are none."""
    try:
        load(next(iter(MODELS)))
    except KinemeError as error:
        return {"available": False, "why": str(error), "robots": []}
    return {"available": True, "why": None, "robots": list(MODELS)}


@router.get("/{name}", response_model=MoveOut, summary="An arm at rest")
def at_rest(studio: Reads, name: ArmName) -> dict[str, Any]:
    """What draws it before it has moved."""
    robot = _arm(name)
    return {**_answer(robot, None), "refusal": None, "scene": posture_data(robot, shapes_of(robot))}


@router.post("/move", response_model=MoveOut, summary="What an arm does to execute a movement")
def move(studio: Reads, body: MoveRequest) -> dict[str, Any]:
    """Joints, and every check; a movement that must not be executed is refused, with how it could be."""
    robot = _arm(body.robot)
    try:
        result = _planned(studio, body, robot)
    except InfeasibleError as error:
        return {**_answer(robot, error.preflight), "refusal": in_studio_words(str(error)), "scene": None}
    scene = scene_data(result, shapes_of(robot))
    if not body.shapes:
        scene |= {"urdf": "", "meshes": []}
    return {**_answer(robot, result.preflight), "refusal": None, "scene": scene}


@router.post(
    "/export",
    summary="What is sent to an arm, as a file",
    response_class=Response,
    responses={200: {"content": {"application/octet-stream": {}}, "description": "The file, with its name."}},
)
def export(studio: Reads, body: SaveRequest) -> Response:
    """Joints over time as a table, an action goal of ROS 2 (.yaml) or a bag; nothing that must not be executed.

    A comment in the goal says which channels are not in it.
    """
    ending = f".{body.format.lower().lstrip('.')}"
    if ending not in {**WRITERS, **_ROS}:
        raise SpecificationError(f"expected one of the formats {', '.join({**WRITERS, **_ROS})}, got {ending[:20]!r}")
    trajectory = _planned(studio, body, _arm(body.robot)).trajectory
    with TemporaryDirectory() as folder:
        path = _ROS.get(ending, write_joints)(Path(folder) / f"joints{ending}", trajectory)
        data, note = path.read_bytes(), not_in_goal(trajectory) if ending == ".yaml" else ""
    return as_file(
        f"# {note}\n".encode() + data if note else data, f"{name_of(studio, body.what)} on {body.robot}", ending
    )


@router.post("/follow", response_model=FollowOut, summary="An arm whose tip follows a hand")
def follow(studio: Reads, body: FollowRequest) -> dict[str, Any]:
    """In an upright square about where the tip is at rest; nothing of it is checked, and nothing is sent to an arm."""
    robot, costs, position, rotation = _follower(body.robot)
    joints = robot.rest if body.joints is None else np.array(body.joints)
    if joints.shape != robot.rest.shape:
        raise SpecificationError(f"expected {robot.n_joints} joints of {robot.name}, got {len(joints)}")
    across, up = np.clip(body.hand, -1.0, 1.0) * _REACH * np.linalg.norm(position)
    joints = np.clip(joints, robot.lower, robot.upper)[None]
    reached = descend(robot, joints, np.add(position, [0.0, across, up]), rotation[None], costs, _STEPS)
    return {"joints": numbers(reached.joints[0]), "distance": float(reached.errors[0])}


def _arm(name: str) -> Robot:
    """Load an arm that comes with kineme: clients name no files."""
    if name not in MODELS:
        raise SpecificationError(f"expected one of the arms {', '.join(MODELS)}, got {name[:80]!r}")
    return load(name)


@lru_cache(maxsize=len(MODELS))
def _follower(name: str) -> tuple[Robot, Any, Any, Any]:
    """Return an arm, its costs of turning, and position and rotation of its tip at rest."""
    ik = InverseKinematics(_arm(name))
    return ik.robot, ik.costs, ik.tip_position, ik.tip_rotation


def _planned(studio: Studio, body: MoveRequest, robot: Robot) -> RobotMovement:
    """Plan the movement that is asked for; raise `InfeasibleError` where it must not be executed."""
    learned = learned_as(studio, body)
    space = space_of(learned.primitive.channels, learned.example, robot)
    if body.goal is not None and body.at is None and space != "joints":
        raise SpecificationError("expected `at` with a goal: where the movement starts in the frame of the robot")
    example = learned.example
    n, arm = example.shape[1], robot if space == "joints" else None
    positions = roles_of(learned.primitive.channels, n, "joints" if arm else "tip", arm).positions
    extent = float(np.ptp(example[:, positions], axis=0).max(initial=0.0)) or 1.0  # in the unit of the library
    generated = generate_at(
        learned,
        body.at,
        body.goal,
        body.duration,
        displacement=None if body.goal is not None else _way(body.displacement, learned, positions, example),
        scale=None if body.size is None or space == "joints" else body.size / extent,
        joints=arm,
        plane=body.plane,
    )
    return move_arm(
        generated.movement,
        robot,
        space=space,
        plane=generated.plane,
        place="as given" if body.at is not None or space == "joints" else "free",
        timing="slowed" if body.slow_down else "generated",
        steps=generated.steps,
        continuous=generated.continuous,
    )


def _way(displacement: list[float] | None, learned: Learned, positions: list[int], path: Array) -> list[float] | None:
    """Return the way of the positions; what moves beside them must move as along the path (T, columns) shown."""
    names = learned.moving_columns
    if displacement is None or len(displacement) != len(names):
        return displacement
    moved = [learned.columns[k] for k in positions]
    shown = dict(zip(learned.columns, path[-1] - path[0], strict=True))
    way = dict(zip(names, displacement, strict=True))
    if other := [name for name in names if name not in moved and abs(way[name] - shown[name]) > _AS_SHOWN]:
        raise SpecificationError(
            f"expected a displacement of {', '.join(moved)} alone, got one of {', '.join(other)} as well: an arm turns "
            "as it was shown; leave these at the demonstrated goal"
        )
    return [way[name] for name in moved]


def _answer(robot: Robot, preflight: Preflight | None) -> dict[str, Any]:
    joints = zip(robot.joints, numbers(robot.lower), numbers(robot.upper), strict=True)
    return {
        "passed": preflight is not None and preflight.passed,
        "checks": [] if preflight is None else checks_as_data(preflight),
        "table": [] if preflight is None else [list(row) for row in preflight_table(preflight).rows],
        "unchecked": [] if preflight is None else list(preflight.unchecked),
        "assumed": list(robot.assumed),
        "joints": [{"name": name, "low": low, "high": high} for name, low, high in joints],
    }
