"""Control tick for generated code: which parts it has, their parameters, sizes and tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.control.allocation import ALLOCATIONS
from spheretwin.control.compensators import Compensators
from spheretwin.control.controller import Controller, controller_of
from spheretwin.control.estimators import difference, differentiator, kalman
from spheretwin.control.law import Law
from spheretwin.control.law_components import feedback
from spheretwin.control.laws import afsm, afsm_eso, pd
from spheretwin.export.c_text import constant, definitions, header, source
from spheretwin.export.motion_code import controller_motion
from spheretwin.export.plant_code import NUMBERS, magnetic_tables
from spheretwin.loop import assembly
from spheretwin.models.base.compiled import uncompiled
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.sections import ResolvedScenario

LAWS: dict[Any, tuple[str, ...]] = {
    pd.step: ("st_law_pd.h",),
    feedback.step: ("st_law_feedback.h", "st_command_history.h"),
    afsm.step: ("st_law_afsm.h", "st_fuzzy.h"),
    afsm_eso.step: ("st_law_afsm_eso.h", "st_command_history.h", "st_fuzzy.h"),
}
"""C files of the laws by their Python functions; the first one has the law."""

LAW_NAMES = ("pd", "pid", "lqi", "afsm", "afsm_eso")

ESTIMATORS: dict[Any, str] = {
    None: "st_estimator_ideal.h",
    difference.step: "st_estimator_difference.h",
    kalman.step: "st_estimator_kalman.h",
    differentiator.step: "st_estimator_differentiator.h",
}
"""C files of the estimators by their Python functions."""

_ALLOCATIONS = {
    "least_norm": ("st_allocation_least_norm.h", "st_least_norm.h"),
    "bounded": ("st_allocation_bounded.h", "st_least_norm.h", "st_simplex.h"),
}


MARGIN_rad = 0.1
"""Distance beyond the range of a hinge at which an angle is still accepted: errors of the sensors."""
LARGEST_ANGLE_rad = 1e5
"""Bound of an angle whose hinge has no end; a float still resolves 0.01 rad there."""
LARGEST_ERROR_rad = 2 * np.pi
LARGEST_ACCELERATION_rad_s2 = 1e4


class ControllerCode(NamedTuple):
    """Control tick of a scenario for generated code."""

    files: dict[str, str]
    """C files by name."""
    groups: int
    period_s: float
    law: str
    estimator: str
    allocation: str


def controller_code(scenario: str, changes: Mapping[str, Any] | None = None) -> ControllerCode:
    """Return the control tick of a scenario for generated code.

    Parameters
    ----------
    scenario : str
        Name or file.
    changes : mapping, optional
        Fields by dotted name.

    Raises
    ------
    InputError
        A field is invalid, or the controller has a part that the generated code does not have.
    """
    config = initial_config(scenarios.load(scenario, changes), None, None)
    resolved, groups = config.scenario, len(config.files.nominal.groups)
    law, estimator = assembly.law_of(resolved), assembly.estimator_of(resolved)
    _check(resolved, law)
    magnetics = assembly.nominal_magnetics(resolved, config.files)
    rows = assembly.empty_run(resolved, magnetics, magnetics)["controller"]
    only = assembly.controllers_of(rows, resolved, [law], magnetics, [estimator], config.files.nominal)
    controller = uncompiled(controller_of)(only, 0)
    law_files, estimator_file = LAWS[law.step], ESTIMATORS[estimator.step if estimator else None]
    names = ["st_controller.h", "st_controller.c", "st_numbers.h", "st_equations.h"]
    names += [*law_files, estimator_file, *_ALLOCATIONS[resolved.allocation]]
    compensators = controller.data.compensators
    names += ["st_governor.h"] * compensators.governor.on + [
        "st_feed_forward.h"
    ] * compensators.feed_forward.on
    return ControllerCode(
        files={
            **{name: source(name) for name in names},
            "st_controller_motion.h": controller_motion(),
            "st_controller_model.h": _model_header(resolved, law, controller, groups),
            "st_controller_tables.h": _table_header(
                resolved, controller, config.files.nominal.hinge_range_rad, law_files[0], estimator_file
            ),
        },
        groups=groups,
        period_s=resolved.controller.period_s,
        law=law.name,
        estimator=resolved.estimator.kind,
        allocation=resolved.allocation,
    )


def _check(scenario: ResolvedScenario, law: Law) -> None:
    """Refuse a controller with a part that the generated code does not have."""
    if law.step not in LAWS:
        raise InputError(f"export: expected a law {', '.join(LAW_NAMES)}, received {law.name}")
    if scenario.allocation not in _ALLOCATIONS:
        raise InputError(
            f"export: expected an allocation {', '.join(ALLOCATIONS)}, received {scenario.allocation}"
        )
    present = {
        "controller.prediction.on": scenario.controller.prediction.on,
        "watchdog.on": scenario.watchdog.on,
        "detector.detect": scenario.detects,
        "manual": scenario.manual.on,
        "sensors.hall": scenario.sensors.hall.on,
    }
    if received := [name for name, is_on in present.items() if is_on]:
        raise InputError(
            "export: expected a controller of estimator, governor, law, feed-forward and allocation alone,"
            f" received {', '.join(received)}"
        )


def _model_header(scenario: ResolvedScenario, law: Law, controller: Controller, groups: int) -> str:
    """Return the header of sizes."""
    compensators, applied = controller.data.compensators, controller.data.applied_torque
    return header(
        definitions(
            {
                "ST_GROUPS": groups,
                "ST_PERIOD_S": f"((st_real){scenario.controller.period_s!r})",
                "ST_LAW_STATE": len(controller.memory),
                "ST_ESTIMATOR_STATE": len(controller.estimator_memory),
                "ST_APPLIED_TORQUE": applied.on,
                "ST_COMMANDS": applied.due + 2,
                "ST_GOVERNOR": compensators.governor.on,
                "ST_FEED_FORWARD": compensators.feed_forward.on,
                "ST_FED_FORWARD": compensators.feed_forward.due + 2,
            }
        )
    )


def _table_header(
    scenario: ResolvedScenario,
    controller: Controller,
    hinge_range_rad: NDArray[np.float64],
    law: str,
    estimator: str,
) -> str:
    """Return the header of parts, bounds, parameters and tables."""
    applied = controller.data.applied_torque
    angles = hinge_range_rad + MARGIN_rad * np.array([-1.0, 1.0])
    numbers: dict[str, Any] = {
        "ST_CURRENT_LIMIT_A": controller.data.current_limit_A,
        "ST_ANGLE_BOUNDS": np.clip(angles, -LARGEST_ANGLE_rad, LARGEST_ANGLE_rad),
        "ST_LARGEST_ERROR": LARGEST_ERROR_rad,
        "ST_LARGEST_RATE": scenario.watchdog.largest_rate_rad_s,
        "ST_LARGEST_ACCELERATION": LARGEST_ACCELERATION_rad_s2,
    }
    if applied.on:
        numbers |= {
            "ST_FRACTION": applied.fraction,
            "ST_OLDER_DECAY": applied.older_lag.decay,
            "ST_OLDER_MEAN": applied.older_lag.mean_share,
            "ST_NEWER_DECAY": applied.newer_lag.decay,
            "ST_NEWER_MEAN": applied.newer_lag.mean_share,
        }
    tables: dict[str, Any] = {"ST_LAW_PARAMETERS": controller.parameters, "ST_LAW_START": controller.memory}
    if scenario.estimator.kind != "ideal":
        tables["ST_ESTIMATOR_PARAMETERS"] = controller.estimator_parameters
    tables |= _compensator_tables(controller.data.compensators)
    files = {"ST_LAW": law, "ST_ESTIMATOR": estimator, "ST_ALLOCATION": _ALLOCATIONS[scenario.allocation][0]}
    return header(
        [
            NUMBERS,
            *(f'#define {name} "{file}"' for name, file in files.items()),
            *(constant(name, value) for name, value in {**numbers, **tables}.items()),
            *magnetic_tables(controller.data.arrangement, controller.tables),
        ]
    )


def _compensator_tables(compensators: Compensators) -> dict[str, Any]:
    governor, feed = compensators.governor, compensators.feed_forward
    tables: dict[str, Any] = {}
    if governor.on:
        tables["ST_GOVERNOR_LARGEST"] = governor.largest_rad_s2
    if feed.on:
        tables |= {
            "ST_FEED_FORWARD_SHARE": feed.share,
            "ST_FEED_FORWARD_INERTIA": feed.inertia,
            "ST_FEED_FORWARD_COULOMB": feed.coulomb_Nm,
            "ST_FEED_FORWARD_VISCOUS": feed.viscous_Nm_s,
            "ST_FEED_FORWARD_SMOOTHING": np.float64(feed.smoothing_rad_s),
            "ST_FEED_FORWARD_FRACTION": np.float64(feed.fraction),
        }
    return tables
