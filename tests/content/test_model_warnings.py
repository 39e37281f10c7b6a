"""Warnings of sessions where model file, torque curve and scenario do not agree."""

import re

from spheretwin import scenario as scenarios
from spheretwin.session import Session
from tests.content.content import command, content_test, scratch
from tests.models.model_files import edited
from tests.twin.cli.test_model_warnings import DEPRECATED, FLAGS, FLEX, GEOMETRY, OPTION

GRAVITY = "plant.gravity_m_s2"


def option(old, new):
    return (OPTION, OPTION.replace(old, new))


LUNAR, WEIGHTLESS = option(">", ' gravity="0 0 -1.62">'), (FLAGS, '<flag gravity="disable"/>')
CASES_OF_OPTIONS = [
    ([option("0.0005", "0.001")], {}), ([option("0.0005", "0.00050000001")], {}),
    ([], {"plant.step_s": 1e-4}),
    ([option("RK4", "implicitfast")], {}), ([option("RK4", "discrete")], {}),
    ([], {"plant.integrator": "Euler"}), ([LUNAR], {GRAVITY: 9.81}), ([WEIGHTLESS], {GRAVITY: 9.81}),
    ([option(">", ' gravity="1 0 -9.8">')], {GRAVITY: 9.8}),
    # What a file states is named also where it is a default of the engine.
    ([(OPTION, '<option integrator="Euler" timestep="0.002" gravity="0 0 -9.81">')], {GRAVITY: 1.62}),
    # Without a difference there is no warning.
    ([], {}), ([(OPTION, "<option>")], {}), ([option(">", ' gravity="1 0 -1.62">')], {}), ([WEIGHTLESS], {}),
    ([(OPTION, '<option integrator="implicitfast" timestep="0.001" gravity="0 0 -1.62">')],
     {"plant.integrator": "implicitfast", "plant.step_s": 0.001, GRAVITY: 1.62}),
]  # fmt: skip
GRID = (
    '<flexcomp name="cloth" type="grid" count="3 3 1" spacing="0.05 0.05 0.05" dim="2" mass="0.1"'
    ' pos="0 0 1"/></worldbody>'
)


def model_warnings():
    folder = scratch("model_warnings")

    def of_session(edits, overrides):
        changes = {"plant.mjcf": str(edited(folder, *edits)), **overrides}
        with Session(scenarios.load("hold", changes)) as session:
            return session.warnings()

    cases = [([edit], {}) for edit in GEOMETRY] + [(GEOMETRY, {})] + CASES_OF_OPTIONS
    cases += [([edit], {"plant.engine": "mujoco"}) for edit in (DEPRECATED, FLEX)]
    lines = [f"{edits} {overrides}: {of_session(edits, overrides)}" for edits, overrides in cases]
    # A run has the warnings of its session among its figures, and prints nothing else; other verbs print it.
    short = f"simulate hold --duration 0.003 --controller.law pd --plant.mjcf {edited(folder)}"
    for edits in ([GEOMETRY[2], option("0.0005", "0.001")], [], [DEPRECATED], [FLEX]):
        edited(folder, *edits)
        printed = command(*short.split(), "--plant.initial-rad", "0.2", "-0.1", "0.3")
        lines += [line for line in printed.splitlines() if not line.startswith("|")]
    path = edited(folder, DEPRECATED)
    lines.append(command("magnetics", "map", "--largest-tilt", "0", "--mjcf", path).partition("stderr:")[2])
    edited(folder, ("</worldbody>", GRID))
    lines.append(command(*short.split()))
    return re.sub(r"line \d{2,}", "line N", "\n".join(lines))


CASES = {"model_warnings": model_warnings}


test_content = content_test(CASES)
