"""Sections in lists: what is wrong in them is told by its dotted name, help shows them, files stay read."""

import pytest

from spheretwin import scenario as scenarios
from spheretwin.disturbances import KINDS
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.reading import field_descriptions
from spheretwin.session import Session

HOLD = '[trajectory]\nshape = "hold"\n[[disturbance.terms]]\n'
SINES = '[trajectory]\nshape = "multisine"\n[[trajectory.components]]\n'


def loaded(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return scenarios.load(str(path))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (
            HOLD + 'kind = "constan"',
            f"disturbance.terms.0.kind: expected one of {', '.join(KINDS)},"
            " received 'constan'; did you mean constant?",
        ),
        (HOLD + "torque_Nm = [1.0, 2.0, 3.0]", "disturbance.terms.0.kind: expected one of constant, steps"),
        (
            HOLD + 'kind = "constant"\ntorque = [1.0, 2.0, 3.0]',
            "expected one of kind, torque_Nm in disturbance.terms.0, received torque; did you mean",
        ),
        (
            HOLD + 'kind = "constant"\ntorque_Nm = [1.0, 2.0, "x"]',
            "disturbance.terms.0.torque_Nm.2: expected a number, received 'x'",
        ),
        (
            SINES + "amplitude = [1.0, 2.0, 3.0]",
            "expected one of amplitude_rad, frequency_Hz, phase_rad in trajectory.components.0,"
            " received amplitude; did you mean amplitude_rad?",
        ),
        (
            SINES + "amplitude_rad = [0.0, 0.0, 1e9]",
            "trajectory.components.0.amplitude_rad.2: expected a number less",
        ),
    ],
)
def test_complaints_name_the_entry(tmp_path, text, complaint):
    with pytest.raises(InputError) as refusal:
        loaded(tmp_path, text)
    assert complaint in str(refusal.value)


def test_help_shows_them_as_they_can_be_given(tmp_path):
    made = loaded(tmp_path, '[trajectory]\nshape = "steps"\n')
    shown = {flag: value for flag, value, _ in field_descriptions(made)}
    assert shown["--trajectory.times-s"] == "1"
    assert shown["--trajectory.angles-rad"] == "[[0.2, -0.1, 0.3]]"
    made = loaded(tmp_path, SINES + "frequency_Hz = [1.0, 2.0, 3.0]")
    shown = {flag: value for flag, value, _ in field_descriptions(made)}
    assert shown["--trajectory.components.0.frequency-Hz"] == "1 2 3"


TORQUES = "t_s,alpha_Nm,beta_Nm,gamma_Nm\n0,0.01,0,0\n1,0.02,0,0\n"
POSES = "t_s,alpha_rad,beta_rad,gamma_rad\n0,0,0,0\n1,0.1,0,0\n"


@pytest.mark.parametrize(
    ("name", "value"),
    [("controller.law", "pd"), ("disturbance.load", 0.5)],
)
def test_a_change_leaves_alone_what_files_held_when_the_run_began(tmp_path, name, value):
    poses, torques = tmp_path / "poses.csv", tmp_path / "torques.csv"
    text = (
        f'[trajectory]\nshape = "waypoints"\nfile = "{poses}"\n'
        f'[[disturbance.terms]]\nkind = "table"\nfile = "{torques}"\n'
    )

    def run(edited):
        poses.write_text(POSES)
        torques.write_text(TORQUES)
        session = Session(loaded(tmp_path, text))
        session.advance(100)
        if edited:
            poses.write_text(POSES.replace("0.1", "0.2"))
            torques.write_text(TORQUES.replace("0.02", "0.03"))
        session.set(name, value)
        return session.advance(1000).values.tobytes()

    assert run(edited=True) == run(edited=False)
