"""What requests and answers about arms hold."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, Field

from kineme.studio.server.records import Number, Point, Text
from kineme.studio.server.rollout_records import Operated


class ArmsOut(BaseModel):
    """Arms that can be asked for."""

    available: bool
    why: str | None
    robots: list[str]


class ArmWanted(Operated):
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


class ArmMoved(BaseModel):
    """What an arm would do, or why it must not; `scene` is what draws it."""

    passed: bool
    refusal: str | None
    checks: list[CheckOut]
    unchecked: list[str]
    assumed: list[str]
    joints: list[JointOut]
    scene: dict[str, Any] | None
