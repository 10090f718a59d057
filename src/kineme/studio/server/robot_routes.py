"""Arms that execute movements, and what is checked before."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from fastapi import APIRouter
from pydantic import BaseModel, Field

from kineme.errors import KinemeError, SpecificationError
from kineme.robots.execution.preflight import Preflight, checks_as_data
from kineme.robots.models.robot import MODELS, Robot, load
from kineme.robots.planning.generate_at import generate_at
from kineme.robots.planning.move import move as move_arm
from kineme.robots.planning.robot_movement import InfeasibleError
from kineme.robots.planning.roles import space_of
from kineme.robots.view.write_view import scene_data, shapes_of
from kineme.studio.server.records import Number, Point, Text, numbers
from kineme.studio.server.refusals import in_studio_words
from kineme.studio.server.rollout_routes import PrimitiveRequest, learned_as
from kineme.studio.server.studio import Reads


class ArmsOut(BaseModel):
    """Arms that can be asked for."""

    available: bool
    why: str | None
    robots: list[str]


class MoveRequest(PrimitiveRequest):
    """A movement for an arm; `size` is its largest extent there [m], `at` and `goal` are in the frame of the robot.

    Instead of a goal, `displacement` is the way from start to goal in the unit of the library.
    """

    robot: Text
    at: Point | None = None
    goal: Point | None = None
    displacement: Point | None = None
    duration: Number | None = Field(None, gt=0)
    size: Number | None = Field(None, gt=0)
    plane: Literal["xy", "xz", "yz"] = "xy"
    slow_down: bool = False


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
    unchecked: list[str]
    assumed: list[str]
    joints: list[JointOut]
    scene: dict[str, Any] | None


router = APIRouter(prefix="/api/robots", tags=["robots"])


@router.get("", response_model=ArmsOut, summary="Which arms there are")
def robots(studio: Reads) -> dict[str, Any]:
    """Those that come with kineme; without the extra `robot`, why there are none."""
    try:
        load(next(iter(MODELS)))
    except KinemeError as error:
        return {"available": False, "why": str(error), "robots": []}
    return {"available": True, "why": None, "robots": list(MODELS)}


@router.post("/move", response_model=MoveOut, summary="What an arm does to execute a movement")
def move(studio: Reads, body: MoveRequest) -> dict[str, Any]:
    """Joints, and every check; a movement that must not be executed is refused, with how it could be."""
    if body.robot not in MODELS:  # clients name no files
        raise SpecificationError(f"expected one of the arms {', '.join(MODELS)}, got {body.robot[:80]!r}")
    robot = load(body.robot)
    learned = learned_as(studio, body)
    space = space_of(learned.primitive.channels, learned.example, robot)
    if body.goal is not None and body.at is None and space != "joints":
        raise SpecificationError("expected `at` with a goal: where the movement starts in the frame of the robot")
    extent = float(np.ptp(learned.example, axis=0).max()) or 1.0  # the largest, in the unit of the library
    generated = generate_at(
        learned,
        body.at,
        body.goal,
        body.duration,
        displacement=None if body.goal is not None else body.displacement,
        scale=None if body.size is None or space == "joints" else body.size / extent,
        joints=robot if space == "joints" else None,
        plane=body.plane,
    )
    try:
        result = move_arm(
            generated.movement,
            robot,
            space=space,
            plane=body.plane,
            place="as given" if body.at is not None or space == "joints" else "free",
            timing="slowed" if body.slow_down else "generated",
            steps=generated.steps,
            continuous=generated.continuous,
        )
    except InfeasibleError as error:
        return {**_answer(robot, error.preflight), "refusal": in_studio_words(str(error)), "scene": None}
    return {**_answer(robot, result.preflight), "refusal": None, "scene": scene_data(result, shapes_of(robot))}


def _answer(robot: Robot, preflight: Preflight | None) -> dict[str, Any]:
    joints = zip(robot.joints, numbers(robot.lower), numbers(robot.upper), strict=True)
    return {
        "passed": preflight is not None and preflight.passed,
        "checks": [] if preflight is None else checks_as_data(preflight),
        "unchecked": [] if preflight is None else list(preflight.unchecked),
        "assumed": list(robot.assumed),
        "joints": [{"name": name, "low": low, "high": high} for name, low, high in joints],
    }
