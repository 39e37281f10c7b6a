"""Commands that install an extra: each kind of installation has its own."""

import json
import sys
from importlib.metadata import distribution

import pytest

from spheretwin.machine.link.transports import open_transport
from spheretwin.models import actuator as actuators
from spheretwin.models.base import extras
from spheretwin.models.base.errors import InputError
from spheretwin.models.design import pole_torque, rotor_field
from tests.models.poses import SECOND


class Installed:
    """Metadata of an installation."""

    def __init__(self, url=None, editable=True):
        self.facts = json.dumps({"url": url, "dir_info": {"editable": editable}}) if url else None

    def read_text(self, name):
        assert name == "direct_url.json"
        return self.facts


def installed(monkeypatch, metadata, *, pip):
    monkeypatch.setattr(extras, "distribution", lambda name: metadata)
    monkeypatch.setattr(extras, "find_spec", lambda name: object() if pip else None)


def test_a_clone_that_make_has_set_up_names_its_target(monkeypatch, tmp_path):
    (tmp_path / "uv.lock").touch()
    monkeypatch.setattr(sys, "prefix", str(tmp_path / ".venv"))
    installed(monkeypatch, Installed(tmp_path.as_uri()), pip=False)
    assert extras.install_command("bench", "plots") == f"make -C {tmp_path} extras EXTRAS='bench plots'"


@pytest.mark.parametrize(
    ("url", "pip", "command"),
    [
        (None, True, "{python} -m pip install 'spheretwin[rl]'"),
        ("file:///clone", True, "{python} -m pip install -e '/clone[rl]'"),
        (None, False, "uv pip install --python {python} 'spheretwin[rl]'"),
    ],
)
def test_an_environment_uses_its_own_python(monkeypatch, url, pip, command):
    installed(monkeypatch, Installed(url), pip=pip)
    assert extras.install_command("rl") == command.format(python=sys.executable)


def test_every_extra_of_the_package_has_a_purpose():
    named = set(distribution("spheretwin").metadata.get_all("Provides-Extra"))
    assert {*extras.PURPOSES, "all"} == named
    (every,) = [line for line in distribution("spheretwin").requires if line.startswith("spheretwin[")]
    assert set(every[every.index("[") + 1 : every.index("]")].split(",")) == {*extras.PURPOSES} - {"gpu"}


@pytest.mark.parametrize("extra", extras.PURPOSES)
def test_missing_packages_are_those_of_the_extra(extra, monkeypatch):
    monkeypatch.setattr(extras, "_is_installed", lambda name: False)
    names = extras.missing_packages(extra)
    assert names
    lines = [line.replace("'", '"') for line in distribution("spheretwin").requires]
    required = [line for line in lines if f'extra == "{extra}"' in line]
    assert len(names) == len(required)
    assert all(line.startswith(name) for name, line in zip(names, required, strict=True))


ACTUATOR = actuators.load()
MISSING = [
    ("magpylib.core", "magpylib to compute the torque curve", "magnetics",
     lambda: pole_torque.compute_curve(ACTUATOR.magnet, ACTUATOR.coil)),
    ("magpylib", "magpylib to compute fields", "magnetics", lambda: rotor_field.compute(SECOND)),
    ("serial", "pyserial", "machine", lambda: open_transport("serial:/dev/ttyS0")),
]  # fmt: skip


@pytest.mark.parametrize(("module", "package", "extra", "call"), MISSING)
def test_a_call_without_its_package_names_the_extra(monkeypatch, module, package, extra, call):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=f"expected {package}, which the extra {extra} installs: "):
        call()


def test_the_error_names_package_extra_and_command():
    error = extras.missing("bench", "viser", "bench")
    assert isinstance(error, InputError)
    command = extras.install_command("bench")
    assert str(error) == f"bench: expected viser, which the extra bench installs: {command}"
