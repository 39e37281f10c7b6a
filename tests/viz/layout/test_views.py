"""Views name existing entities only, for any hardware, law and faults."""

import pytest
from rerun.chunk import RrdReader

from spheretwin import scenario as scenarios
from spheretwin.session import Session
from spheretwin.viz.layout.layout import VIEWS
from spheretwin.viz.layout.view import STYLES, VALUES, VIEW_NAMES
from spheretwin.viz.recording import plots
from tests.viz.recording.panels import layouts
from tests.viz.recording.recordings import recorded

OPEN = {"target": "coil.00", "mode": "open", "start_s": 0.05, "detection": True}

RUNS = {
    "afsm": ("nutation", {}),
    "pd": ("sinusoid", {"controller.law": "pd"}),
    "pid": ("sinusoid", {"controller.law": "pid"}),
    "observer": ("tilt", {"controller.law": "afsm_eso"}),
    "electronics": ("hold", {"hardware": "electronics", "plant.engine": "mujoco", "fault": [OPEN]}),
    "around": (
        "tilt",
        {
            "hardware": "electronics",
            "plant.engine": "mujoco",
            "controller.governor.acceleration_rad_s2": [20.0] * 3,
            "controller.prediction.on": True,
            "controller.feed_forward.inertia": [1.0] * 3,
        },
    ),
    "failed": (
        "sinusoid",
        {"controller.law": "pd", "disturbance.load": 2.0, "plant.modelling_error": 0.2, "duration": 2.0},
    ),
}


@pytest.fixture(scope="module", params=RUNS)
def path(request, tmp_path_factory):
    path, (name, fields) = tmp_path_factory.mktemp("views") / f"{request.param}.rrd", RUNS[request.param]
    recorded(path, name, **{"duration": 0.3, **fields})
    return path


def contents(layout):
    """What views show: paths of entities, or of all below an origin."""
    origins = {
        path: values[0][0] for (path, name), values in layout.items() if name == "ViewBlueprint:space_origin"
    }
    for (path, name), values in layout.items():
        if name == "ViewContents:query":
            for line in values[0]:
                yield line.replace("$origin", origins.get(path.removesuffix("/ViewContents"), "/")).replace(
                    "//", "/"
                )


def container_names(layout):
    return {
        entity.removeprefix("/"): values[0][0]
        for (entity, name), values in layout.items()
        if name in ("ContainerBlueprint:display_name", "ViewBlueprint:display_name") and values[0]
    }


# States that have a lane only if they change.
LANES = ("/failsafe_reason", "/fault")


def exists(wanted, entities):
    below = wanted.removesuffix("/**").removeprefix("+ ")
    if below in LANES:
        return True
    return any(entity == below or entity.startswith(f"{below}/") for entity in entities)


def test_views_show_only_what_the_recording_holds(path):
    entities = {chunk.entity_path for chunk in RrdReader(path).stream()}
    for layout in layouts(path):
        shown = list(contents(layout))
        assert len(shown) > 5
        assert [each for each in shown if not exists(each, entities)] == []


def fields(path):
    """Fields of structs, nested ones with a dot before them, by entity and component."""
    results = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name.startswith((VALUES, STYLES)):
                for field in batch.schema.field(name).type.value_type:
                    looks = field.type if name.startswith(STYLES) else []
                    there = results.setdefault((chunk.entity_path, name), set())
                    there |= {f".{field.name}[]", *(f".{field.name}.{look.name}[]" for look in looks)}
    return results


def mappings_of(path):
    """Entity and mapping of each component of each visualizer."""
    return [
        (f"/{entity.partition('/overrides/')[2].partition('/visualizers')[0]}", each)
        for (entity, name), values in layouts(path)[-1].items()
        for mappings in values
        for each in (mappings if name == "VisualizerInstruction:component_map" else [])
    ]


def test_what_draws_a_signal_finds_its_values_and_its_looks(path):
    there, taken = fields(path), mappings_of(path)
    assert len(taken) > 30
    missing = [
        (entity, each)
        for entity, each in taken
        if each["selector"] not in there[entity, each["source_component"]]
    ]
    assert missing == []


@pytest.mark.parametrize("name", ["afsm", "pid", "observer"])
def test_every_signal_of_a_law_is_in_a_plot(name, tmp_path):
    scenario, fields = RUNS[name]
    recorded(path := tmp_path / "run.rrd", scenario, **fields, duration=0.02)
    with Session(scenarios.load(scenario, fields)) as session:
        own = {signal.name for signal in session.law.signals}
    assert own
    selectors = {each["selector"] for _, each in mappings_of(path) if each["target"] == "Scalars:scalars"}
    assert {f".{name}[]" for name in own} <= selectors


def test_the_names_of_views_are_those_of_the_registry():
    assert tuple(VIEWS) == VIEW_NAMES


@pytest.mark.parametrize("view", VIEW_NAMES)
def test_a_recording_that_takes_long_is_laid_out_before_its_end_with_its_chosen_view(
    view, tmp_path, monkeypatch
):
    monkeypatch.setattr(plots, "OPENED_AFTER_s", 0.0)
    recorded(path := tmp_path / "run.rrd", duration=0.05, shown=view)
    opening, whole = layouts(path)
    names = container_names(whole)
    active = [
        names.get(each[0])
        for (_, name), values in whole.items()
        for each in values
        if name == "ContainerBlueprint:active_tab" and each
    ]
    assert [name for name in active if name in VIEW_NAMES] == [view]
    assert set(container_names(opening).values()) & set(VIEW_NAMES) == {view}
    entities = {chunk.entity_path for chunk in RrdReader(path).stream()}
    assert all(exists(each, entities) for each in contents(opening))
