"""The rivals: fronts against their definition, families about what is shipped, pairs by hand."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.control.laws.registry import LAWS
from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce import page
from spheretwin.twin.reproduce.laws import BY_LAW as LABELS
from spheretwin.twin.reproduce.page import Chapter
from spheretwin.twin.reproduce.planning import planned, scenario_of
from spheretwin.twin.reproduce.rivals import conditions, fronts, paired, told
from spheretwin.twin.reproduce.rivals.conditions import BARE_TILT, EASY, GOVERNED_TILT, PROTOTYPE, SETTINGS
from spheretwin.twin.reproduce.rivals.families import BY_LAW, FAMILIES
from spheretwin.twin.reproduce.rivals.rivals import EXPERIMENT
from spheretwin.twin.reproduce.rows import rows
from spheretwin.twin.reproduce.running import carried_out, failed
from spheretwin.viz.palette import LAW_COLOURS, LAW_MARKS

# Few values, so that coordinates are often the same.
COORDINATE = st.sampled_from([1.0, 2.0, 3.0, 5.0, 8.0, np.nan])


def dominates(one, other):
    return bool(np.all(one <= other) and np.any(one < other))


@given(st.lists(st.tuples(COORDINATE, COORDINATE), max_size=12))
def test_a_front_is_what_nothing_dominates(listed):
    values = np.array(listed).reshape(-1, 2)
    whole = ~np.isnan(values).any(axis=1)
    kept = fronts.front(values)
    for place, value in enumerate(values):
        assert kept[place] == (whole[place] and not any(dominates(other, value) for other in values[whole]))


def test_every_law_has_one_family_a_label_and_marks_of_its_own():
    assert sorted(family.law for family in FAMILIES) == sorted(LAWS)
    assert set(LABELS) == set(LAW_MARKS) == set(LAW_COLOURS) == set(LAWS)
    assert len({marker for marker, _ in LAW_MARKS.values()}) == len(LAW_MARKS)


@pytest.mark.parametrize("law", LAWS)
def test_a_family_is_geometric_about_what_is_shipped(law):
    family = BY_LAW[law]
    ratios = np.array(family.ratios)
    assert len(ratios) == 7
    np.testing.assert_allclose(ratios[1:] / ratios[:-1], 1.5, rtol=1e-12)
    assert 1.0 in family.ratios
    shipped = LAWS[law]()
    assert (
        scenario_of(conditions.case(EASY, family, 1.0), None).controller
        == scenario_of(
            conditions.case(EASY, family, 1.0)._replace(fields={"controller.law": law}), None
        ).controller
    )
    changed = scenario_of(conditions.case(EASY, family, 1.5), None).controller
    for name in LAWS[law].model_fields:
        was, now = getattr(shipped, name), getattr(changed, name)
        power = family.powers.get(name)
        if power is None:
            assert now == was
        else:
            np.testing.assert_allclose(now, np.array(was) * 1.5**power, rtol=1e-12)


@pytest.mark.parametrize("law", ["pid", "computed_torque"])
def test_a_triple_pole_stays_one(law):
    """(s + ω)³ at every setting."""
    for ratio in BY_LAW[law].ratios:
        gains = scenario_of(conditions.case(EASY, BY_LAW[law], ratio), None).controller
        w = 40.0 * ratio
        found = (gains.damping[0], gains.stiffness[0], gains.integral[0])
        np.testing.assert_allclose(found, (3 * w, 3 * w**2, w**3), rtol=1e-12)


def test_all_on_the_prototype_say_what_stands_around_them():
    for setting in PROTOTYPE:
        for family in setting.families:
            controller = scenario_of(conditions.case(setting, family, 1.0), None).controller
            governed = setting is GOVERNED_TILT
            assert controller.governor.on == governed
            assert controller.feed_forward.friction == ((0.8 if governed else 0.0),) * 3
            inertia = 1.0 if governed and family.law == "pid" else 0.0
            assert controller.feed_forward.inertia == (inertia,) * 3
            assert getattr(controller, "preset", "prototype") == "prototype"


def outcome(error, variation, status=Status.COMPLETED):
    """With the same error on all hinges."""
    return SimpleNamespace(
        status=status,
        figures={"current_variation_A_s": variation},
        max_abs_error=np.full(3, error),
        tail_rms_error=np.full(3, error / 10),
    )


def made_up(setting, by_law):
    """Outcomes of laws by (ratio, errors of two seeds, variation)."""
    return {
        conditions.case(setting, BY_LAW[law], ratio).name: [outcome(each, variation) for each in errors]
        for law, settings in by_law.items()
        for ratio, errors, variation in settings
    }


def test_points_are_medians_and_no_numbers_where_a_run_was_lost():
    outcomes = made_up(EASY, {"pid": [(1.0, (2.0, 4.0), 5.0), (1.5, (1.0, 1.0), 9.0)]})
    lost = conditions.case(EASY, BY_LAW["pid"], 1.5).name
    outcomes[lost][1] = outcome(1.0, 9.0, Status.FAILSAFE)
    first, second = fronts.points(EASY, outcomes)
    assert (first.largest_rad, first.variation_A_s, first.shipped) == (3.0, 5.0, True)
    assert np.isnan(second.largest_rad)
    assert fronts.on_front([first, second], fronts.LARGEST) == [first]
    assert fronts.best([first, second]) == first
    assert fronts.best([first, second], 4.9) is None


def test_findings_say_who_is_on_the_front_and_how_far_the_paper_s_laws_are_behind():
    settings = {"afsm": [(1.0, (8.0, 8.0), 20.0)], "adaptive_fuzzy": [(1.0, (6.0, 6.0), 15.0)]}
    outcomes = made_up(EASY, {**settings, "afsm_eso": [(1.0, (2.0, 2.0), 4.0)]})
    (found,) = told.findings(outcomes)
    assert "points of AFSM-ESO 1;" in found.text
    assert "adaptive fuzzy 3.0, AFSM 4.0 times" in found.text
    assert "less of both than 1 of the 1 points" in found.text
    assert told.findings({}) == []


def test_pairs_count_seeds():
    outcomes = made_up(BARE_TILT, {"afsm_eso": [(1.0, (2.0, 2.0), 4.0)], "pid": [(1.0, (1.0, 5.0), 9.0)]})
    (pair,) = paired.pairs(BARE_TILT, outcomes)
    assert (pair.less_error, pair.less_variation, pair.both) == ((False, True), (True, True), 1)
    (found,) = paired.findings(outcomes)
    assert "less error under 1 and less variation under 2 of 2 seeds" in found.text


@pytest.fixture(scope="module")
def short():
    """One seed of two settings of three laws everywhere, a tenth as long."""
    chosen = [
        conditions.case(setting, BY_LAW[law], ratio)
        for setting in SETTINGS
        for law in conditions.PAIRED
        for ratio in (1.0, 1.5)
    ]
    cases = [case._replace(fields={**case.fields, "duration": 0.6}) for case in chosen]
    plan = planned(EXPERIMENT._replace(cases=lambda: cases), seeds=1)
    return plan, carried_out(plan)


def test_rows_and_page_have_what_ran(short, tmp_path):
    plan, outcomes = short
    assert failed(plan, outcomes) == []
    listed = rows(plan, outcomes)
    json.dumps(listed, allow_nan=False)
    assert [(row["setting"], row["ratio"]) for row in listed[:2]] == [
        ("m 0.2, L 1", 1.0),
        ("m 0.2, L 1", 1.5),
    ]
    chapter = Chapter(plan.experiment, EXPERIMENT.tell(outcomes), EXPERIMENT.findings(outcomes))
    written = page.write(tmp_path, [chapter], "", {})[0].read_text(encoding="utf-8")
    for figure in ("rivals_ideal.png", "rivals_prototype.png"):
        assert (tmp_path / figure).stat().st_size > 0
        assert f"({figure})" in written
    assert "Paired on the prototype" in written
    assert written.count("| rivals | ") == len(SETTINGS) + len(PROTOTYPE)


def test_the_drawn_front_is_the_front(short):
    from spheretwin.twin.reproduce.rivals import drawing

    _, outcomes = short
    axes = drawing.ideal(outcomes).figure.axes[0]
    common = axes.lines[0].get_xydata()
    of = fronts.on_front(fronts.points(EASY, outcomes), fronts.LARGEST)
    np.testing.assert_allclose(common, fronts.plane(of, fronts.LARGEST) * [1.0, 1e3])
