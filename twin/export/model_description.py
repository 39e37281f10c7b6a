"""Model description of an FMU in the XML of FMI 2.0 and 3.0."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.metadata import version
from typing import Literal, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from spheretwin.export.plant_code import PlantCode, Variable

InterfaceKind = Literal["co-simulation", "model-exchange"]

UNITS: dict[str, dict[str, float]] = {
    "1": {},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "A": {"A": 1},
    "A/s": {"A": 1, "s": -1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "degC": {"K": 1, "offset": 273.15},
    "K/s": {"K": 1, "s": -1},
    "1/K": {"K": -1},
    "J/K": {"kg": 1, "m": 2, "s": -2, "K": -1},
    "K/W": {"kg": -1, "m": -2, "s": 3, "K": 1},
    "kg.m2": {"kg": 1, "m": 2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N.m.s": {"kg": 1, "m": 2, "s": -1},
    "N.m/rad": {"kg": 1, "m": 2, "s": -2, "rad": -1},
}
"""Exponents of the base units."""

_RATES = {"rad": "rad/s", "rad/s": "rad/s2", "A": "A/s", "degC": "K/s"}
_KINDS = {"co-simulation": "CoSimulation", "model-exchange": "ModelExchange"}


class _Variable(NamedTuple):
    name: str
    reference: int
    """Value reference: the order of `st_fmu.h`."""
    causality: str
    variability: str
    unit: str
    description: str
    start: float | None = None
    derivative_of: int | None = None
    bounds: tuple[float, float] | None = None

    def attributes(self) -> dict[str, str]:
        """Attributes that both versions have in common, of any type."""
        initial = {} if self.causality in ("input", "independent") else {"initial": "exact"}
        if self.derivative_of is not None:
            initial = {"initial": "calculated"}
        return {
            "name": self.name,
            "valueReference": str(self.reference),
            "description": self.description,
            "causality": self.causality,
            "variability": self.variability,
            **initial,
        }

    def numbers(self) -> dict[str, str]:
        """Attributes of a real number."""
        ends = zip(("min", "max"), self.bounds or (), strict=False)
        start = {} if self.start is None else {"start": repr(self.start)}
        return {"unit": self.unit, **{name: repr(float(value)) for name, value in ends}, **start}


def model_description(
    model: PlantCode, fmi: int, kind: InterfaceKind, identifier: str, token: str, sources: Sequence[str]
) -> str:
    """Return the content of ``modelDescription.xml``.

    Parameters
    ----------
    model : PlantCode
    fmi : int
        2 or 3.
    kind : str
    identifier : str
        Name of the binaries.
    token : str
        Digest that the sources hold too.
    sources : sequence of str
        C files to compile.
    """
    names = ("guid", "FMUstate", "FMUstate", "Derivative")
    names = names if fmi == 2 else ("instantiationToken", "FMUState", "FMUState", "Derivatives")
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{fmi}.0",
            "modelName": f"spheretwin.{model.name}",
            names[0]: token,
            "description": f"Plant of a spherical actuator, {model.inputs} as inputs",
            "generationTool": f"spheretwin {version('spheretwin')}",
            "variableNamingConvention": "structured",
            **({"numberOfEventIndicators": "0"} if fmi == 2 else {}),
        },
    )
    abilities = {
        f"canGetAndSet{names[1]}": "true",
        f"canSerialize{names[2]}": "true",
        f"providesDirectional{names[3]}": "true",
    }
    if kind == "co-simulation":
        abilities["canHandleVariableCommunicationStepSize"] = "true"
    interface = SubElement(root, _KINDS[kind], {"modelIdentifier": identifier, **abilities})
    if fmi == 2:
        files = SubElement(interface, "SourceFiles")
        for name in sources:
            SubElement(files, "File", {"name": name})
    variables = list(_variables(model))
    _add_units(root, variables)
    SubElement(SubElement(root, "LogCategories"), "Category", {"name": "logStatusError"})
    SubElement(root, "DefaultExperiment", _experiment(model, kind))
    (_add_variables_2 if fmi == 2 else _add_variables_3)(root, variables, kind)
    ElementTree.indent(root)
    text: str = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def build_description(identifier: str, sources: Sequence[str]) -> str:
    """Return the content of ``buildDescription.xml`` of FMI 3.0."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = SubElement(root, "BuildConfiguration", {"modelIdentifier": identifier})
    files = SubElement(configuration, "SourceFileSet", {"language": "C99"})
    for name in sources:
        SubElement(files, "SourceFile", {"name": name})
    ElementTree.indent(root)
    text: str = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _variables(model: PlantCode) -> Iterator[_Variable]:
    yield _Variable("time", 0, "independent", "continuous", "s", "simulation time")
    reference = 1
    states = [(quantity, name, value) for quantity in model.states for name, value in _numbers(quantity)]
    for quantity, name, value in states:
        text, bounds = quantity.description, (quantity.least, quantity.largest)
        yield _Variable(name, reference, "output", "continuous", quantity.unit, text, value, None, bounds)
        reference += 1
    for place, (quantity, name, _) in enumerate(states, 1):
        text, unit = f"time derivative of {name}", _RATES[quantity.unit]
        yield _Variable(f"der({name})", reference, "local", "continuous", unit, text, derivative_of=place)
        reference += 1
    for quantities, causality in ((model.commands, "input"), (model.parameters, "parameter")):
        for quantity in quantities:
            variability = "continuous" if causality == "input" else "fixed" if quantity.fixed else "tunable"
            for name, value in _numbers(quantity):
                yield _Variable(
                    name, reference, causality, variability, quantity.unit, quantity.description, value, None,
                    (quantity.least, quantity.largest),
                )  # fmt: skip
                reference += 1


def _numbers(quantity: Variable) -> Iterator[tuple[str, float]]:
    return zip(quantity.names, quantity.values, strict=True)


def _add_units(root: Element, variables: Sequence[_Variable]) -> None:
    definitions = SubElement(root, "UnitDefinitions")
    for name in dict.fromkeys(variable.unit for variable in variables):
        unit = SubElement(definitions, "Unit", {"name": name})
        SubElement(unit, "BaseUnit", {base: f"{exponent:g}" for base, exponent in UNITS[name].items()})


def _experiment(model: PlantCode, kind: InterfaceKind) -> dict[str, str]:
    step_s = {quantity.name: quantity.values[0] for quantity in model.parameters}["thermal_period_s"]
    experiment = {"startTime": "0.0", "stopTime": "1.0"}
    return {**experiment, "stepSize": repr(step_s)} if kind == "co-simulation" else experiment


def _add_variables_2(root: Element, variables: Sequence[_Variable], kind: InterfaceKind) -> None:
    """Add variables and structure of FMI 2.0, which counts variables from 1."""
    parent, structure = SubElement(root, "ModelVariables"), SubElement(root, "ModelStructure")
    outputs, derivatives, initial = (
        SubElement(structure, name) for name in ("Outputs", "Derivatives", "InitialUnknowns")
    )
    for index, variable in enumerate(variables, 1):
        scalar = SubElement(parent, "ScalarVariable", variable.attributes())
        derivative = {} if variable.derivative_of is None else {"derivative": str(variable.derivative_of + 1)}
        SubElement(scalar, "Real", {**variable.numbers(), **derivative})
        if variable.causality == "output":
            own = str(index) if kind == "model-exchange" else ""
            SubElement(outputs, "Unknown", {"index": str(index), "dependencies": own})
        elif variable.derivative_of is not None:
            for element in (derivatives, initial):
                SubElement(element, "Unknown", {"index": str(index)})


def _add_variables_3(root: Element, variables: Sequence[_Variable], kind: InterfaceKind) -> None:
    """Add variables and structure of FMI 3.0, which names variables by their value reference."""
    parent, structure = SubElement(root, "ModelVariables"), SubElement(root, "ModelStructure")
    for variable in variables:
        derivative = {} if variable.derivative_of is None else {"derivative": str(variable.derivative_of)}
        SubElement(parent, "Float64", {**variable.attributes(), **variable.numbers(), **derivative})
    for variable in variables:
        if variable.causality == "output":
            reference = str(variable.reference)
            own = reference if kind == "model-exchange" else ""
            SubElement(structure, "Output", {"valueReference": reference, "dependencies": own})
    for name in ("ContinuousStateDerivative", "InitialUnknown"):
        for variable in variables:
            if variable.derivative_of is not None:
                SubElement(structure, name, {"valueReference": str(variable.reference)})
