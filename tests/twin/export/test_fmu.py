"""FMUs of all four kinds: FMPy's checks, runs against `simulate`, states, derivatives, parameters."""

import ctypes
import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

import spheretwin as st
from spheretwin import plant
from spheretwin.export import fmu as fmus
from spheretwin.export.fmu import plant_files, write_fmu
from spheretwin.export.plant_code import plant_code
from spheretwin.models.base.errors import InputError
from tests.requirements import C_COMPILER, needs_c_compiler
from tests.twin.export.generated import SANITIZERS, WARNINGS, compiled

CHANGES = {
    "plant.coulomb_Nm": [2e-3] * 3,
    "plant.viscous_Nm_s": [1e-4] * 3,
    "plant.payload_kg": 0.05,
    "disturbance.load": 1.0,
}
KINDS = [(fmi, kind) for fmi in (2, 3) for kind in ("co-simulation", "model-exchange")]


@pytest.fixture(scope="module")
def model():
    return plant_code("nutation", CHANGES)


@pytest.fixture(scope="module")
def files(model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmu")
    return {
        (fmi, kind): write_fmu(folder / f"{fmi}_{kind}.fmu", model, fmi, kind).path for fmi, kind in KINDS
    }


def names(quantities):
    return [name for quantity in quantities for name in quantity.names]


def simulated(path, model, t, inputs, **settings):
    """Angles and rates (n, 6) of a run in FMPy, with inputs in its order."""
    signals = np.zeros(len(t), dtype=[(name, "f8") for name in ("time", *names(model.commands))])
    signals["time"] = t
    for name, column in zip(names(model.commands), inputs.T, strict=True):
        signals[name] = column
    outputs = names(model.states[:2])
    result = fmpy.simulate_fmu(
        str(path), stop_time=t[-1], output_interval=1e-3, input=signals, output=outputs, **settings
    )
    return np.stack([result[name] for name in outputs], axis=1)


@pytest.mark.release("compiles and checks FMUs for 4 s; changes with FMPy and the compiler")
@pytest.mark.parametrize(("fmi", "kind"), KINDS)
def test_fmpy_finds_no_problem(fmi, kind, files):
    assert validate_fmu(str(files[fmi, kind])) == []
    with zipfile.ZipFile(files[fmi, kind]) as archive:
        entries = archive.namelist()
    assert {"sources/st_plant.c", "sources/fmi.c", "sources/st_plant_tables.h"} <= set(entries)
    assert any(entry.startswith("binaries/") for entry in entries) == bool(C_COMPILER)


def test_values_have_the_order_of_the_description(model, files):
    described = fmpy.read_model_description(str(files[3, "co-simulation"]))
    starts = {variable.name: variable.start for variable in described.modelVariables}
    for quantity in (*model.states, *model.commands, *model.parameters):
        for name, value in zip(quantity.names, quantity.values, strict=True):
            assert float(starts[name]) == value
    references = [variable.valueReference for variable in described.modelVariables]
    assert references == list(range(len(references)))


@needs_c_compiler
@pytest.mark.parametrize("fmi", [2, 3])
def test_co_simulation_is_simulate(fmi, model, files):
    changes = CHANGES | {"plant.engine": "lagrangian", "duration": 0.5}
    run = st.simulate("nutation", changes).telemetry
    inputs = np.hstack([run["current_command_A"], run["disturbance_Nm"]])
    reached = simulated(files[fmi, "co-simulation"], model, run["t_s"], inputs)
    # Bound of the specification; the difference is some 1e-13.
    np.testing.assert_allclose(reached, np.hstack([run["q_rad"], run["qdot_rad_s"]]), atol=1e-9)
    assert np.ptp(run["q_rad"], axis=0).max() > 0.5


@needs_c_compiler
@pytest.mark.parametrize(
    "fmi", [pytest.param(2, marks=pytest.mark.release("0.6 s; FMI 3 has the same derivatives")), 3]
)
def test_model_exchange_is_the_limit_of_small_steps(fmi, tmp_path):
    # Smooth friction without Coulomb's term: the steps then converge as their square.
    changes = {"plant.viscous_Nm_s": [1e-3] * 3, "plant.payload_kg": 0.05, "drive.time_constant_s": 1e-2}
    model = plant_code("nutation", changes)
    path = write_fmu(tmp_path / "n.fmu", model, fmi, "model-exchange").path
    current = 4 * np.cos(np.arange(18.0))
    inputs = np.tile(np.concatenate([current, [0.005, -0.01, 0.0]]), (2, 1))
    reached = simulated(path, model, np.array([0.0, 0.05]), inputs, relative_tolerance=1e-12, solver="CVode")[
        -1
    ]

    def with_steps(count):
        """Steps of the twin, with the mean current of the lag."""
        parameters, h = plant.parameters("nutation", changes), 0.05 / count
        state = plant.State(*np.array([values.values for values in model.states[:2]]))
        for k in range(count):
            share = 1 - 1e-2 / h * (np.exp(-k * h / 1e-2) - np.exp(-(k + 1) * h / 1e-2))
            state = plant.step(state, share * current, inputs[0, 18:], parameters, h)
        return np.concatenate(state)

    coarse, fine = with_steps(2000), with_steps(4000)
    limit = fine + (fine - coarse) / 3
    # Extrapolated, 25 µs leave 1e-11; the solver has a tolerance of 1e-12 a step, and 1e-14 of rounding.
    np.testing.assert_allclose(reached, limit, atol=1e-9)
    assert np.abs(limit[:3] - model.states[0].values).max() > 0.01


class Instance:
    """One FMU in FMPy, without its simulation loop."""

    def __init__(self, path, folder):
        description = fmpy.read_model_description(str(path))
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.fmi = int(description.fmiVersion[0])
        interface, suffix = description.coSimulation, "Slave"
        if interface is None:
            interface, suffix = description.modelExchange, "Model"
        self.fmu = getattr(getattr(fmpy, f"fmi{self.fmi}"), f"FMU{self.fmi}{suffix}")(
            guid=self.of_version(description.guid, description.instantiationToken),
            unzipDirectory=fmpy.extract(str(path), str(folder)),
            modelIdentifier=interface.modelIdentifier,
            instanceName="plant",
        )
        self.fmu.instantiate()
        if self.fmi == 2:
            self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def of_version(self, second, third):
        return second if self.fmi == 2 else third

    def call(self, second, third, *arguments, **named):
        """Call a function by its name in FMI 2 and in FMI 3."""
        return getattr(self.fmu, self.of_version(second, third))(*arguments, **named)

    def get(self, *names):
        return np.array(self.call("getReal", "getFloat64", [self.references[name] for name in names]))

    def set(self, name, value):
        self.call("setReal", "setFloat64", [self.references[name]], [value])

    def step(self, t, count=1):
        for k in range(count):
            self.fmu.doStep(currentCommunicationPoint=t + 1e-3 * k, communicationStepSize=1e-3)


@pytest.fixture
def opened(files, tmp_path):
    """Open FMUs; they are freed at the end."""
    instances = []

    def open_one(fmi, kind):
        instances.append(Instance(files[fmi, kind], tmp_path))
        return instances[-1]

    yield open_one
    for instance in instances:
        instance.fmu.terminate()
        instance.fmu.freeInstance()


@pytest.fixture(params=[2, 3])
def instance(request, opened):
    return opened(request.param, "co-simulation")


ANGLES = ("q_rad.alpha", "q_rad.beta", "q_rad.gamma", "current_A[2]", "winding_degC[2]")
RATES = ("qdot_rad_s.alpha", "qdot_rad_s.beta", "qdot_rad_s.gamma")


@needs_c_compiler
def test_a_saved_state_continues_with_the_same_bits(instance):
    instance.set("current_command_A[2]", 1.5)
    instance.step(0.0, 5)
    saved = instance.call("getFMUstate", "getFMUState")
    data = instance.call("serializeFMUstate", "serializeFMUState", saved)
    instance.step(5e-3, 20)
    first = instance.get(*ANGLES)
    instance.set("torque_gain[2]", 0.5)
    instance.step(25e-3, 5)
    for state in (saved, instance.call("deSerializeFMUstate", "deserializeFMUState", data)):
        instance.call("setFMUstate", "setFMUState", state)
        instance.step(5e-3, 20)
        np.testing.assert_array_equal(instance.get(*ANGLES), first)
        instance.call("freeFMUstate", "freeFMUState", state)


@needs_c_compiler
def test_parameters_can_be_changed_while_it_runs(instance):
    instance.set("current_command_A[2]", 1.5)
    instance.step(0.0, 20)
    before = instance.get(*RATES)
    for hinge in ("alpha", "beta", "gamma"):
        instance.set(f"inertia_kg_m2.{hinge}", 1e6)
    instance.set("current_command_A[2]", 0.0)
    instance.step(20e-3, 1)
    # No torque accelerates such an inertia; in 1 ms the axes exchange 1e-3 times products of rates below 0.3.
    np.testing.assert_allclose(instance.get(*RATES), before, atol=1e-4)
    assert np.abs(before).max() > 0.1


@needs_c_compiler
def test_leaving_the_range_requests_the_end(instance):
    instance.set("disturbance_Nm.alpha", -5.0)
    fmu = instance.fmu
    if instance.fmi == 3:
        *_, terminate, _, last = fmu.doStep(0.0, 1.0)
    else:
        with pytest.raises(fmpy.fmi1.FMICallException, match=r"discard|status 2"):
            fmu.doStep(0.0, 1.0)
        value, time = ctypes.c_int(), ctypes.c_double()
        fmu.dll.fmi2GetBooleanStatus(ctypes.c_void_p(fmu.component), 3, ctypes.byref(value))
        fmu.dll.fmi2GetRealStatus(ctypes.c_void_p(fmu.component), 2, ctypes.byref(time))
        terminate, last = bool(value), time.value
    assert terminate
    assert 0 < last < 0.1
    assert abs(instance.get("q_rad.alpha")[0]) > np.radians(80)


@needs_c_compiler
def test_declared_bounds_are_enforced_and_a_refused_set_changes_nothing(instance, files):
    described = fmpy.read_model_description(str(files[instance.fmi, "co-simulation"]))
    settable = [one for one in described.modelVariables if one.causality in ("input", "parameter")]
    names = [one.name for one in settable]
    instance.fmu.reset()  # fixed parameters can be set before the start alone
    before = instance.get(*names)
    for one in settable:
        least, largest = float(one.min), float(one.max)
        assert least <= float(one.start) <= largest
        for value in (np.nextafter(least, -np.inf), np.nextafter(largest, np.inf), np.nan, np.inf, -1e300):
            both = [instance.references["disturbance_Nm.alpha"], one.valueReference]
            with pytest.raises(fmpy.fmi1.FMICallException):
                instance.call("setReal", "setFloat64", both, [0.5, value])
    np.testing.assert_array_equal(instance.get(*names), before)
    instance.step(0.0)


@needs_c_compiler
def test_fixed_parameters_are_set_before_the_start_alone(instance, files):
    described = fmpy.read_model_description(str(files[instance.fmi, "co-simulation"]))
    fixed = [one for one in described.modelVariables if one.variability == "fixed"]
    assert [one.name for one in fixed] == ["step_s", "thermal_period_s"]
    for one in fixed:
        with pytest.raises(fmpy.fmi1.FMICallException, match="error"):
            instance.set(one.name, float(one.start))
    instance.fmu.reset()
    for one in fixed:
        instance.set(one.name, 2e-4)
    np.testing.assert_array_equal(instance.get(*(one.name for one in fixed)), 2e-4)


@needs_c_compiler
@pytest.mark.parametrize(
    ("time", "duration"), [(0.0, v) for v in (0, -1, np.nan, np.inf, 1e18)] + [(np.nan, 1e-3)]
)
def test_steps_out_of_range_are_refused(instance, time, duration):
    before = instance.get(*ANGLES, "time")
    with pytest.raises(fmpy.fmi1.FMICallException):
        instance.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=duration)
    np.testing.assert_array_equal(instance.get(*ANGLES, "time"), before)


@needs_c_compiler
@pytest.mark.parametrize("fmi", [2, 3])
def test_invalid_states_do_not_reach_the_derivatives(fmi, opened):
    instance = opened(fmi, "model-exchange")
    n, rates = 44, [f"der({rate})" for rate in RATES]
    before = instance.get(*ANGLES, *rates)
    for value in (np.nan, np.inf, 1e300):
        for place in (0, 3, 6, 43):
            x = [20.0] * n
            x[place] = value
            with pytest.raises(fmpy.fmi1.FMICallException):
                instance.fmu.setContinuousStates((ctypes.c_double * n)(*x), n)
    np.testing.assert_array_equal(instance.get(*ANGLES, *rates), before)
    with pytest.raises(fmpy.fmi1.FMICallException):
        instance.set("lag_s[0]", 0.0)


@needs_c_compiler
def test_damaged_states_are_refused(instance):
    instance.step(0.0, 3)
    saved = instance.call("getFMUstate", "getFMUState")
    data = bytearray(instance.call("serializeFMUstate", "serializeFMUState", saved))
    generator = np.random.default_rng(0)
    damaged = [bytes(data[:-1]), b"", bytes(data) + b"0", bytes(len(data))]
    for place in generator.integers(len(data), size=60):
        flipped = data.copy()
        flipped[place] ^= 1 << int(generator.integers(8))
        damaged.append(bytes(flipped))
    for content in damaged:
        with pytest.raises(fmpy.fmi1.FMICallException):
            instance.call("deSerializeFMUstate", "deserializeFMUState", content)
    instance.call("freeFMUstate", "freeFMUState", saved)


@needs_c_compiler
@pytest.mark.parametrize("fmi", [2, 3])
def test_directional_derivatives_are_those_of_the_derivatives(fmi, opened):
    instance = opened(fmi, "model-exchange")
    instance.set("current_command_A[4]", 2.0)
    unknowns = [f"der({rate})" for rate in RATES]
    x = np.array([0.1, -0.2, 0.3, 1.0, -2.0, 0.5, *np.linspace(-1, 1, 18), *[20.0] * 20])

    def derivatives(values):
        instance.fmu.setContinuousStates((ctypes.c_double * len(values))(*values), len(values))
        return instance.get(*unknowns)

    small = np.zeros(len(x))
    small[1] = 1e-6
    difference = (derivatives(x + small) - derivatives(x - small)) / 2e-6
    derivatives(x)
    arguments = [instance.references[name] for name in unknowns], [instance.references["q_rad.beta"]], [1.0]
    exact = instance.fmu.getDirectionalDerivative(*arguments)
    # Rounding of the difference: 1e-16 / 1e-6 of accelerations of some 100 rad/s².
    np.testing.assert_allclose(exact, difference, rtol=1e-7, atol=1e-6)


@needs_c_compiler
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_declarations_are_those_of_the_standard(fmi, model, files, tmp_path):
    with zipfile.ZipFile(files[fmi, "co-simulation"]) as archive:
        archive.extractall(tmp_path)
    headers = Path(fmpy.__file__).parent / "c-code"
    for flags in ([], ["-DST_STANDARD_HEADERS", f"-I{headers}"]):
        command = [*C_COMPILER, *WARNINGS, *flags, "-c", "fmi.c", "-o", f"{len(flags)}.o"]
        done = subprocess.run(command, cwd=tmp_path / "sources", capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    if shutil.which("nm"):
        command = ["nm", tmp_path / "sources" / "0.o"]
        listed = subprocess.run(command, capture_output=True, text=True).stdout
        defined = {line.split()[-1].lstrip("_") for line in listed.splitlines() if " T " in line}
        text = (headers / f"fmi{fmi}FunctionTypes.h").read_text()
        required = set(re.findall(rf"\b(fmi{fmi}[A-Z]\w+)TYPE\b", text))
        assert len(required) > 20
        assert required <= defined


@pytest.mark.release("compiler, 2 s; test_model_exchange has the values of the same interface")
@needs_c_compiler
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_interface_runs_under_sanitizers(fmi, files, tmp_path):
    with zipfile.ZipFile(files[fmi, "model-exchange"]) as archive:
        archive.extractall(tmp_path)
    driver = shutil.copy(Path(__file__).parent / f"fmi{fmi}_driver.c", tmp_path / "sources")
    sources = [Path(driver).name, "st_fmu.c", "st_plant.c"]
    program = compiled(tmp_path / "sources", sources, "driver", *SANITIZERS)
    done = subprocess.run([program], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "expected the" in done.stdout
    assert "expected a value reference" in done.stdout


def test_the_same_plant_gives_the_same_sources_and_token(model, files, tmp_path):
    again = write_fmu(tmp_path / "again.fmu", model, 2, "co-simulation").path
    with zipfile.ZipFile(files[2, "co-simulation"]) as first, zipfile.ZipFile(again) as second:
        sources = [name for name in first.namelist() if not name.startswith("binaries/")]
        assert [first.read(name) for name in sources] == [second.read(name) for name in sources]
    other = plant_code("nutation", CHANGES | {"plant.payload_kg": 0.06})
    assert plant_files(other)["st_plant_tables.h"] != plant_files(model)["st_plant_tables.h"]


def test_without_a_compiler_the_sources_are_inside(model, tmp_path, monkeypatch):
    monkeypatch.setattr(fmus, "host_compiler", lambda: None)
    written = write_fmu(tmp_path / "n.fmu", model, 3, "co-simulation")
    assert written.binaries == []
    assert validate_fmu(str(written.path)) == []


def test_a_plant_without_derivatives_is_refused(tmp_path):
    instant = plant_code("nutation", {"drive.time_constant_s": 0.0})
    with pytest.raises(InputError, match=r"expected drive\.time_constant_s above 0 for model-exchange"):
        write_fmu(tmp_path / "n.fmu", instant, 2, "model-exchange")
    assert write_fmu(tmp_path / "n.fmu", instant, 2, "co-simulation").path.exists()
