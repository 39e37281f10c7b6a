"""Short experiments on the shipped scenarios."""

from spheretwin.models.telemetry.status import Status
from spheretwin.paper.experiment import Case, Experiment, ResultTable, Section
from spheretwin.paper.rows import of_axis, spread_deg

SHORT = {"duration": 0.2, "plant.engine": "lagrangian"}
NOISY = Case("noisy", "tilt", {**SHORT, "hardware": "prototype"}, told={"paper": [0.01, None, None]})
IDEAL = Case("ideal", "tilt", SHORT, draws=False)
# 5 N·m: PD cannot hold it, and the rotor leaves its workspace.
LOST = Case("lost", "hold", {"duration": 1.0, "controller.law": "pd", "disturbance.load": 100.0}, draws=False)


def tell(outcomes):
    rows = [(name, spread_deg(of_axis(found, "max_abs_error", 0))) for name, found in outcomes.items()]
    return [
        Section(
            "What | was found", "In *words*, and <b>no tag</b>.", [ResultTable("Errors", ("case", "α"), rows)]
        )
    ]


def experiment(*cases, **more):
    return Experiment("short", "A short one", "It is over soon.", lambda: list(cases), tell, **more)


def allowed(case):
    return case._replace(ends=(Status.COMPLETED, Status.LEFT_WORKSPACE))
