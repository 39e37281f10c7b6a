"""Scenarios: shipped ones, files, overrides, and complaints in one line."""

import pytest

from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.base.errors import InputError
from spheretwin.scenario import reading
from spheretwin.scenario.changes import with_change as changed_in
from spheretwin.scenario.fields import every_field
from spheretwin.scenario.sections import Scenario

PATHS = ("plant.mjcf", "plant.torque_curve", "nominal.torque_curve")


def test_physics_step_is_the_one_the_model_file_opens_with():
    assert mjcf.read(actuators.MJCF_PATH).described.opt.timestep == scenarios.load("hold").plant.step_s


def test_help_shows_fields_as_they_can_be_given():
    event = [{"t_s": 0.1, "set": "disturbance.load", "value": 2.0}]
    shown = {}
    for changes in (
        {"trajectory": {"shape": "steps"}, "event": event},
        {"trajectory": {"shape": "multisine", "components": [{"frequency_Hz": [1.0, 2.0, 3.0]}]}},
    ):
        rows = reading.field_descriptions(scenarios.load("nutation", changes))
        shown |= {flag: value for flag, value, _ in rows}
    assert shown["--trajectory.times-s"] == "1"
    assert shown["--trajectory.angles-rad"] == "[[0.2, -0.1, 0.3]]"
    assert shown["--trajectory.components.0.frequency-Hz"] == "1 2 3"
    assert shown["--event.0.set"] == "disturbance.load"
    assert {"--name", "--plant.mjcf", "--plant.initial-rad", "--drive.current-limit-A"} < set(shown)


HOLD = '[trajectory]\nshape = "hold"\n[plant]\n'


def test_a_byte_order_mark_is_no_part_of_a_scenario(tmp_path):
    (path := tmp_path / "mine.toml").write_text("\ufeffduration = 2\n" + HOLD, encoding="utf-8")
    assert scenarios.load(str(path)).duration == 2.0


def test_a_tilde_is_the_user_s_home_and_other_paths_stay_beside_the_file(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "mine").mkdir()
    text = f'{HOLD}mjcf = "~/a.xml"\ntorque_curve = "curves/b.csv"\n[nominal]\ntorque_curve = "c.csv"\n'
    (tmp_path / "mine" / "s.toml").write_text(text)

    def paths(source, changes=None):
        scenario = scenarios.load(source, changes)
        return scenario.plant.mjcf, scenario.plant.torque_curve, scenario.nominal.torque_curve

    folder = f"{tmp_path}/mine"
    assert paths("~/mine/s.toml") == (f"{tmp_path}/a.xml", f"{folder}/curves/b.csv", f"{folder}/c.csv")
    changes = {"plant.mjcf": "here.xml", "plant.torque_curve": "~/c.csv", "nominal.torque_curve": "~/d.csv"}
    assert paths("~/mine/s.toml", changes) == ("here.xml", f"{tmp_path}/c.csv", f"{tmp_path}/d.csv")
    monkeypatch.chdir(tmp_path / "mine")
    assert paths("s.toml")[1:] == ("curves/b.csv", "c.csv")


def test_a_folder_called_tilde_is_one(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", "/elsewhere")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "~").mkdir()
    (tmp_path / "~" / "s.toml").write_text(f'{HOLD}mjcf = "a.xml"\n')
    assert scenarios.load("./~/s.toml").plant.mjcf == "./~/a.xml"


def test_a_description_may_have_several_lines(tmp_path):
    (path := tmp_path / "mine.toml").write_text(f'description = """\na\n\tb"""\n{HOLD}')
    assert scenarios.load(str(path)).description == "a\n\tb"


def test_a_long_seed_is_taken_and_an_endless_one_told():
    assert scenarios.load("hold", reading.overrides(["--seed", "9" * 4000])).seed == 10**4000 - 1
    for digits in (4301, 100_000):
        with pytest.raises(InputError, match=r"seed: expected a whole number, received '9+…9+'"):
            scenarios.load("hold", reading.overrides(["--seed", "9" * digits]))


def test_every_field_that_names_a_file_is_known_as_one():
    names = {name for name, _ in every_field(Scenario) if name.endswith(("mjcf", "curve", "file"))}
    marked = {name for name, field in every_field(Scenario) if (field.json_schema_extra or {}).get("path")}
    assert names == marked - {"controller.law"}
    assert set(PATHS) <= names


@pytest.mark.parametrize("name", PATHS)
def test_a_tilde_in_a_change_is_the_user_s_home(tmp_path, monkeypatch, name):
    monkeypatch.setenv("HOME", str(tmp_path))
    section, field = name.split(".")
    with_change = changed_in(scenarios.load("hold"), name, "~/a")
    assert getattr(getattr(with_change, section), field) == f"{tmp_path}/a"
    again = changed_in(with_change, "disturbance.load", 1.0)
    assert getattr(getattr(again, section), field) == f"{tmp_path}/a"


def test_a_new_member_starts_from_its_own_defaults_over_a_shipped_scenario():
    tilt = scenarios.load("hold", {"trajectory.shape": "tilt"}).trajectory
    assert tilt == scenarios.load("tilt").trajectory
    assert scenarios.load("hold", {"trajectory.shape": "hold"}) == scenarios.load("hold")


@pytest.mark.parametrize(
    ("section", "tag", "text", "chosen"),
    [
        ("trajectory", "shape", "", "tilt"),
        ("controller", "law", '[controller]\nlaw = "afsm_eso"\npreset = "fast"\n', "pid"),
        ("estimator", "kind", '[estimator]\nkind = "kalman"\nnoise_rad = [1e-4, 1e-4, 1e-4]\n', "difference"),
    ],
)
def test_the_rule_holds_for_every_family(tmp_path, monkeypatch, section, tag, text, chosen):
    """A file counts as the user's text or as shipped; only the latter gives way."""
    (tmp_path / "mine.toml").write_text(f'[trajectory]\nshape = "hold"\nangle_rad = [0, 0, 1]\n{text}')
    changes = {f"{section}.{tag}": chosen}
    with pytest.raises(InputError, match=f", a field of {tag} "):
        scenarios.load(str(tmp_path / "mine.toml"), changes)
    monkeypatch.setattr(reading, "FOLDER", tmp_path)
    assert getattr(getattr(scenarios.load("mine", changes), section), tag) == chosen
