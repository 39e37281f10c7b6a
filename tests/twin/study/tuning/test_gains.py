"""Gains and the fields that they set, and what is refused before the first trial."""

import pytest

from spheretwin.control.law_components.feedback import triple_pole
from spheretwin.control.laws import LAWS
from spheretwin.models.base.errors import InputError
from spheretwin.study.optimise import Gain
from spheretwin.study.row import Rows
from spheretwin.study.study import load, made
from spheretwin.study.tuning.gains import gains_of, middle, numbers, values
from spheretwin.study.tuning.tuning import tune
from tests.twin.study.tuning.cases import TWO, gain, study

SHIPPED = load("tuning")


def pid_gains():
    (law,) = (law for law in SHIPPED.law if law["law"] == "pid")
    return gains_of(SHIPPED, law, Rows(SHIPPED))


@pytest.mark.parametrize("law", SHIPPED.law, ids=lambda law: law["law"])
def test_the_shipped_tuning_starts_with_the_laws_own_gains(law):
    preset = {name: law[name] for name in ("preset",) if name in law}
    gains, default = gains_of(SHIPPED, law, Rows(SHIPPED)), LAWS[law["law"]](**preset)
    own = {name: tuple(value) for name, value in law.items() if name not in ("law", "preset")}
    for field, value in values(gains, middle(gains)).items():
        name, _, entry = field.removeprefix("controller.").partition(".")
        at = [int(entry)] if entry else [0, 1, 2]
        # Gains that are the products of factors and powers: some units in the last place.
        assert [getattr(default, name)[i] for i in at] == pytest.approx([value] * len(at), rel=1e-15)
    assert own == {name: getattr(default, name) for name in own}


def test_the_shipped_tuning_of_pid_is_of_its_three_gains():
    fields = values(pid_gains(), middle(pid_gains()))
    assert set(fields) == {f"controller.{name}" for name in ("stiffness", "damping", "integral")}


def test_a_gain_may_set_several_fields_and_a_field_be_set_by_several():
    chosen = {"bandwidth_rad_s": 25.0, "stiffness_ratio": 1.5, "damping_ratio": 0.5}
    stiffness, damping, integral = triple_pole(25.0)
    assert values(pid_gains(), chosen) == pytest.approx(
        {
            "controller.stiffness": 1.5 * stiffness,
            "controller.damping": 0.5 * damping,
            "controller.integral": integral,
        },
        rel=1e-15,  # the factors are the same in another order: some units in the last place
    )


def test_without_a_start_gains_are_tried_in_the_middle_of_their_ranges(tmp_path):
    even = gain("damping", 10.0, 30.0, log=False)
    two = study(tmp_path, gains=(gain(low=30.0, high=3000.0), even))
    gains = gains_of(two, None, Rows(two))
    assert middle(gains) == pytest.approx({"controller.stiffness": 300.0, "controller.damping": 20.0})


def test_an_optional_gain_that_is_off_leaves_its_fields_alone():
    gains = [Gain.model_validate(gain(optional=True)), Gain.model_validate(gain("damping", 5.0, 500.0))]
    assert list(numbers(gains)) == ["controller.stiffness", "controller.damping", gains[0].switch]
    chosen = {"controller.stiffness": 300.0, "controller.damping": 20.0}
    both = dict(chosen)
    assert values(gains, {**chosen, gains[0].switch: 0.5}) == values(gains, chosen) == both
    assert values(gains, {**chosen, gains[0].switch: 0.49}) == {"controller.damping": 20.0}


BAD_GAINS = {
    "nothing": ({"low": 1.0, "high": 2.0}, "expected field or sets of a gain, received neither"),
    "both": (gain(sets=[{"field": "a.b"}]), "expected field or sets of a gain, received both"),
    "no name": ({"sets": [{"field": "a.b"}], "low": 1.0, "high": 2.0}, "expected a name of a gain"),
    "empty range": (gain(low=2.0, high=2.0), "expected low below high, received 2 and 2"),
    "no logarithm": (gain(low=0.0), "expected low above 0"),
    "start outside": (gain(start=1.0), "expected start from 30 to 3000, received 1"),
    "unknown": (gain(step=1.0), "step"),
    "no number": (gain(low=float("nan")), "low"),
}


@pytest.mark.parametrize("case", BAD_GAINS)
def test_a_gain_that_is_none_is_refused_in_a_line(tmp_path, case):
    bad, message = BAD_GAINS[case]
    with pytest.raises(InputError) as refusal:
        study(tmp_path, gains=(bad,))
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


BAD_OBJECTIVES = {
    "entries of one number": ([{"metric": "exact", "of": ["alpha"]}], "expected no entries of exact"),
    "twice": (["exact", "exact"], "expected different objectives"),
    "three": (["exact", "miss", "slowness"], "objective"),
    "none": ([], "objective"),
    "limits of the first": ([{"metric": "exact", "limits": [1.0]}, "miss"], "expected limits on the second"),
    "limits without order": (
        ["exact", {"metric": "miss", "limits": [2.0, 1.0]}],
        "expected ascending limits",
    ),
    "limits from below": (
        ["exact", {"metric": "miss", "limits": [1.0], "direction": "maximise"}],
        "expected minimise with limits, received maximise",
    ),
    "a mean to be large": (
        [{"metric": "exact", "over": "geometric_mean", "direction": "maximise"}],
        "expected minimise with geometric_mean, received maximise",
    ),
    "no direction": ([{"metric": "exact", "direction": "down"}], "direction"),
}


@pytest.mark.parametrize("case", BAD_OBJECTIVES)
def test_objectives_that_are_none_are_refused_in_a_line(tmp_path, case):
    bad, message = BAD_OBJECTIVES[case]
    with pytest.raises(InputError) as refusal:
        study(tmp_path, objectives=bad)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def changed(folder, **fields):
    """The study of two objectives with some of its fields changed."""
    whole = study(folder, **TWO)
    dumped = {**whole.model_dump(mode="json"), "optimise": whole.optimise.model_dump(mode="json")}
    return made({**dumped, **fields}, "known")


def with_optimise(folder, **fields):
    return changed(folder, optimise={**study(folder, **TWO).optimise.model_dump(mode="json"), **fields})


BAD_STUDIES = {
    "no section": (lambda folder: changed(folder, optimise=None), "expected [optimise] in a study"),
    "a field too": (
        lambda folder: changed(folder, fields={"controller.law": "pd", "controller.stiffness": 5.0}),
        "expected controller.stiffness as a gain alone",
    ),
    "an axis too": (
        lambda folder: changed(
            folder, axis=[{"field": "controller.damping", "kind": "values", "values": [1.0, 2.0]}]
        ),
        "expected controller.damping as a gain alone",
    ),
    "in the law too": (
        lambda folder: changed(folder, fields={}, law=[{"law": "pd", "damping": 9.0}]),
        "expected controller.damping in [[law]] or as a gain, received both",
    ),
    "no such field": (
        lambda folder: with_optimise(folder, gain=[gain("stifness")]),
        "stifness; did you mean stiffness?",
    ),
    "no such law": (
        lambda folder: with_optimise(folder, gain=[gain(), gain("damping", law="pdd")]),
        "expected pd as the law of a gain, received pdd; did you mean pd?",
    ),
    "no gain of the law": (
        lambda folder: with_optimise(folder, gain=[gain(law="afsm")]),
        "expected gains of pd, received none",
    ),
    "one name twice": (lambda folder: with_optimise(folder, gain=[gain(), gain()]), "different names"),
    "one start alone": (
        lambda folder: with_optimise(folder, gain=[gain(start=50.0), gain("damping")]),
        "expected start of every gain of pd, received none of controller.damping",
    ),
    "no such figure": (
        lambda folder: with_optimise(folder, objective=[{"metric": "rms_error"}]),
        "received 'rms_error'; did you mean rms_error_rad?",
    ),
    "trials of local": (
        lambda folder: study(folder, **TWO, sampler="local", trials=20),
        "expected draws and perturbations of the sampler local, received trials",
    ),
    "draws of another": (
        lambda folder: study(folder, **TWO, draws=20),
        "expected draws with the sampler local alone, received tpe",
    ),
    "no scenario": (lambda folder: with_optimise(folder, gain=[gain(low=1e12, high=1e13)]), "stiffness"),
}


@pytest.mark.parametrize("case", BAD_STUDIES)
def test_what_cannot_be_tuned_is_refused_in_a_line_before_a_trial(tmp_path, case):
    make, message = BAD_STUDIES[case]
    with pytest.raises(InputError) as refusal:
        tune(make(tmp_path), tmp_path / "out")
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert not (tmp_path / "out").exists()
