"""All parts of the cross-check, one after another: a new one is a file and a row."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple, Protocol, TypeVar

from spheretwin.crosscheck import coil_driven, dynamics, identities, prototype, trajectories
from spheretwin.models import actuator as actuators
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.checks import Check, bound_shares
from spheretwin.models.base.errors import InputError
from spheretwin.models.mjcf import read
from spheretwin.viz.pages import markdown as pieces
from spheretwin.viz.pages.markdown import Drawing, ReportPage

F = TypeVar("F", bound="PartResult")

STATES = 10_000
"""Default number of random states at which the dynamics are compared."""


class Subject(NamedTuple):
    """Subject of the checks."""

    mjcf: Path
    actuator: Actuator
    states: int
    """Random states at which formulas are compared."""


class PartResult(Protocol):
    """Result of a part: its checks, and the data of its figures."""

    @property
    def checks(self) -> list[Check]:
        """Rows of the part."""
        ...


class CheckPart(NamedTuple):
    """One row of the suite."""

    name: str
    examine: Callable[[Subject], PartResult]


PARTS = (
    CheckPart("dynamics", lambda on: dynamics.compare(on.mjcf, on.actuator, on.states)),
    CheckPart("identities", lambda on: identities.check_identities(on.actuator, on.states)),
    CheckPart("trajectories", lambda on: trajectories.compare_trajectories(on.mjcf, on.actuator)),
    CheckPart("coil-driven motion", lambda on: coil_driven.compare(on.mjcf, on.actuator)),
    CheckPart("prototype", lambda on: prototype.compare(on.mjcf, on.actuator)),
)


class CrosscheckResult(NamedTuple):
    """Findings of every part by its name."""

    findings: Mapping[str, PartResult]

    @property
    def checks(self) -> list[Check]:
        """Every check, in the order of the parts."""
        return [check for finding in self.findings.values() for check in finding.checks]

    def of(self, kind: type[F]) -> F:
        """Findings of a kind."""
        return next(finding for finding in self.findings.values() if isinstance(finding, kind))


def run(
    mjcf: Path = actuators.MJCF_PATH, states: int = STATES, begun: Callable[[str], None] = lambda part: None
) -> CrosscheckResult:
    """Run every check.

    Parameters
    ----------
    mjcf : Path
        Model file; the shipped one unless given.
    states : int
        Random states at which formulas are compared.
    begun : callable
        Receives the name of each of `PARTS` as it begins.

    Raises
    ------
    InputError
        The model cannot be read, or holds physics that the Lagrangian does not know.
    EngineError
        The reference trajectory could not be integrated.
    """
    subject = Subject(mjcf, actuators.load(mjcf), states)
    if unknown := read(mjcf).unknown_to_the_lagrangian:
        raise InputError(
            f"crosscheck {mjcf}: expected rigid bodies on three hinges, which the Lagrangian computes,"
            f" received a model with {', '.join(unknown)}"
        )
    findings: dict[str, PartResult] = {}
    for part in PARTS:
        begun(part.name)
        findings[part.name] = part.examine(subject)
    return CrosscheckResult(findings)


def draw_convergence(evidence: CrosscheckResult) -> Drawing:
    """Orders of convergence."""
    from spheretwin.viz.figures import crosscheck

    measured = evidence.of(trajectories.Trajectories).convergence
    figure = crosscheck.convergence(measured, "Order of convergence against DOP853")
    return Drawing("convergence.svg", "Largest error over 5 s at five steps, with the fitted slopes.", figure)


def draw_differences(evidence: CrosscheckResult) -> Drawing:
    """Differences of engines and Lagrangian at random states."""
    from spheretwin.viz.figures import crosscheck

    measured = evidence.of(dynamics.Dynamics)
    figure = crosscheck.spreads(
        measured.differences, measured.bounds, "Engines against the Lagrangian at random states"
    )
    caption = "Relative differences at random states of all three plants; 1e-18 stands for none at all."
    return Drawing("dynamics.svg", caption, figure)


def draw_margins(evidence: CrosscheckResult) -> Drawing:
    """Value over bound of each check."""
    from spheretwin.viz.figures import crosscheck

    figure = crosscheck.margins(bound_shares(evidence.checks), "Share of the bound of each check")
    caption = "Value over bound. Orders of convergence have two bounds: see below."
    return Drawing("margins.svg", caption, figure)


def draw_trajectory(evidence: CrosscheckResult) -> Drawing:
    """A motion by given torques, and how far engine and reference part."""
    from spheretwin.viz.figures import crosscheck

    followed = evidence.of(trajectories.Trajectories)
    figure = crosscheck.motion(
        followed.t_s,
        followed.q_rad,
        followed.difference_rad,
        trajectories.BOUND_rad,
        "MuJoCo RK4 against DOP853 on the Lagrangian, torques held over 10 ms",
    )
    return Drawing(
        "trajectory.svg", "Nutation by given torques, and how far engine and reference part.", figure
    )


FIGURES: tuple[Callable[[CrosscheckResult], Drawing], ...] = (
    draw_margins,
    draw_differences,
    draw_trajectory,
    draw_convergence,
)


NAME = "crosscheck"


def write(folder: Path, evidence: CrosscheckResult, figure_format: str = "svg") -> list[Path]:
    """Write the page and its figures into a folder; return both forms of the page.

    Parameters
    ----------
    folder : Path
        Exists.
    evidence : CrosscheckResult
        Result of the suite.
    figure_format : str
        Format of the figures in addition to SVG.

    Raises
    ------
    InputError
        A file cannot be written there.
    """
    lead = (
        "Comparison of the engine (MuJoCo) with the Lagrangian model, which is derived independently, and"
        f" with Pinocchio. {pieces.verdict(evidence.checks)}"
    )
    figures = pieces.figures_section(draw(evidence) for draw in FIGURES)
    sections = [*figures, pieces.checks_section(evidence.checks)]
    return ReportPage(NAME, "Cross-check", lead, sections, "spheretwin crosscheck").write(
        folder, figure_format
    )
