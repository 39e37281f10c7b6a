"""Settings of an environment: scenario, actions, length of an episode, reward, and what varies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, JsonValue, ValidationError

from spheretwin.control.policy import TORQUE_LIMIT_Nm
from spheretwin.models.base.errors import InputError, did_you_mean, one_line
from spheretwin.study.axes import Normal, Uniform

Weight = Annotated[float, Field(ge=0, le=1e6)]


class Reward(BaseModel):
    """Weights of the terms of the reward of a control period, each of which is at most zero."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    tracking: Weight = Field(1.0, description="norm of the errors of the hinge angles, per 0.1 rad")
    rate: Weight = Field(0.1, description="norm of the errors of the hinge rates, per 10 rad/s")
    effort: Weight = Field(0.01, description="mean square of the action over its limit")
    failure: Weight = Field(100.0, description="once, if the rotor leaves the workspace or diverges")


class Settings(BaseModel):
    """Settings of an environment."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    scenario: str = Field(description="name or file of the scenario: reference, plant and disturbance")
    changes: dict[str, JsonValue] = Field({}, description="fields of the scenario and their values")
    actions: Literal["torque", "current"] = Field(
        "torque",
        description="shares, from -1 to 1, of the largest torque on each hinge, without a field, or of the"
        " current limit of each group",
    )
    torque_limit_Nm: Annotated[float, Field(gt=0, le=1e3)] = Field(
        TORQUE_LIMIT_Nm, description="largest torque on a hinge, N·m"
    )
    episode_s: Annotated[float, Field(gt=0, le=600)] = Field(2.0, description="length of an episode")
    step_s: Annotated[float, Field(gt=0, le=0.1)] = Field(
        1e-3, description="physics step; a whole number of them make a control period"
    )
    axes: tuple[Annotated[Uniform | Normal, Field(discriminator="kind")], ...] = Field(
        (), description="fields that differ from episode to episode, and their distributions"
    )
    variants: Annotated[int, Field(ge=1, le=100_000)] = Field(
        64, description="different episodes, drawn at the start; each has a seed of its own, unless it is set"
    )
    variants_seed: Annotated[int, Field(ge=0)] = Field(0, description="seed of these")
    angle_noise_rad: Annotated[float, Field(ge=0, le=1)] = Field(
        0.0, description="standard deviation of the noise of observed angles, new in each control period"
    )
    rate_noise_rad_s: Annotated[float, Field(ge=0, le=1e3)] = Field(
        0.0, description="standard deviation of the noise of observed rates"
    )
    delay_periods: Annotated[int, Field(ge=0, le=1000)] = Field(
        0, description="control periods by which observed angles and rates are late"
    )
    reward: Reward = Reward()


class Task(NamedTuple):
    """A registered environment."""

    name: str
    defaults: Mapping[str, Any]


_SOME_POSE = tuple(Uniform(field=f"trajectory.angle_rad.{hinge}", low=-0.4, high=0.4) for hinge in range(3))

TASKS = {
    task.name: task
    for task in (
        Task("Track", {"scenario": "sinusoid"}),
        Task("Hold", {"scenario": "hold"}),
        Task("Point", {"scenario": "hold", "axes": _SOME_POSE, "variants": 256}),
    )
}


def settings_of(task: str, given: Mapping[str, Any]) -> Settings:
    """Return the settings of a task with some replaced.

    Raises
    ------
    InputError
        An unknown task or setting, or a value out of range.
    """
    if task not in TASKS:
        raise InputError(f"environment: expected one of {', '.join(TASKS)}, received {task!r}")
    if unknown := sorted(set(given) - set(Settings.model_fields)):
        hint = did_you_mean(unknown[0], list(Settings.model_fields))
        raise InputError(
            f"environment {task}: expected settings among {', '.join(Settings.model_fields)},"
            f" received {unknown[0]}{hint}"
        )
    try:
        return Settings.model_validate({**TASKS[task].defaults, **given})
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise InputError(
            one_line(f"environment {task}: {place}: {first['msg']}, received {first['input']!r}")
        ) from None
