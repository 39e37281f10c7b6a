"""Set-up of many controllers at once: every row is that of a single one."""

import numpy as np
import pytest
from pydantic import BaseModel

from spheretwin.control.compensators.feed_forward import (
    FeedForward,
    FeedForwardSection,
    NominalRotor,
    fill_feed_forward,
)
from spheretwin.control.compensators.prediction import (
    DelayModel,
    Prediction,
    PredictionSection,
    fill_prediction,
)
from spheretwin.control.compensators.reference_governor import Governor, GovernorSection, fill_governor
from spheretwin.control.controller import ControllerData, controller, controller_of
from spheretwin.control.estimators import ESTIMATORS
from spheretwin.control.estimators.estimator import Sampling
from spheretwin.control.law import NominalModel
from spheretwin.control.laws import LAWS
from spheretwin.control.manual_currents import ManualSection, sample_currents
from spheretwin.control.supervision.enabled_groups import REPORTED, EnabledGroups, mark_faulty_groups
from spheretwin.control.supervision.fault_detector import (
    Detector,
    DetectorSection,
    NominalCurrents,
    fill_detector,
)
from spheretwin.control.supervision.watchdog import (
    MeasurementLimits,
    Watchdog,
    WatchdogSection,
    fill_watchdog,
)
from spheretwin.models.base.columns import MixedRowsError, column_of
from spheretwin.models.base.compiled import uncompiled
from spheretwin.models.magnetics import torque_model

pytestmark = pytest.mark.uncompiled

ROWS, BLOCKS = 5, 20
SIZES = {"groups": 4, "lines": 2, "delays": 64}
AXES = np.array([1.0, 2.0, 3.0])


class Draw:
    """Random arguments of a row; what a block shares follows from the block."""

    def __init__(self, block, row):
        self.random, self.block = np.random.default_rng((block, row)), block
        self.period_s = self.number(1e-3)

    def number(self, scale):
        return float(scale * self.random.uniform(0.5, 2.0))

    def axes(self, scale):
        return tuple(self.number(scale) for _ in range(3))

    def groups(self, scale):
        """Return one number of all groups in some rows, one of each in others."""
        one = self.number(scale)
        return one if self.random.integers(2) else tuple(self.number(scale) for _ in range(4))

    def flag(self):
        return bool(self.random.integers(2))

    def count(self):
        return int(self.random.integers(1, 50))

    def unless_shared(self, value):
        """Return None in every second block."""
        return None if self.block % 2 else value


def governor(draw):
    return GovernorSection(acceleration_rad_s2=draw.unless_shared(draw.axes(10.0))), draw.period_s


def prediction(draw):
    delay_s = draw.number(2e-3) * draw.flag()
    model = DelayModel(draw.period_s, delay_s, draw.groups(1e-3), np.array(draw.axes(1e-4)))
    return PredictionSection(on=draw.flag()), model


def feed_forward(draw):
    shares = [draw.axes(1.0) if draw.flag() else (0.0,) * 3 for _ in range(2)]
    section = FeedForwardSection(friction=shares[0], inertia=shares[1], smoothing_rad_s=draw.number(0.01))
    rotor = NominalRotor(np.array(draw.axes(1e-4)), draw.axes(1e-3), draw.axes(1e-3))
    return section, rotor, draw.period_s, draw.number(2e-3) * draw.flag()


def detector(draw):
    section = DetectorSection(
        threshold_A=draw.unless_shared(draw.number(0.1)), ticks=draw.unless_shared(draw.count())
    )
    swing_V = draw.number(10.0) if draw.flag() else np.inf
    errors = draw.number(8.0), draw.number(0.1), draw.number(0.02)
    coils = draw.groups(1e-3), swing_V, draw.groups(2.0), draw.groups(1e-3)
    return section, draw.flag(), NominalCurrents(draw.period_s, *errors, *coils)


def watchdog(draw):
    section = WatchdogSection(
        on=draw.flag(),
        rundown_s=draw.number(0.05),
        stale_ticks=draw.count(),
        largest_rate_rad_s=draw.number(60.0),
        edge_margin_rad=draw.number(0.02),
    )
    ranges = np.array([[-1.0, 1.0], [-2.0, 2.0], [-np.inf, np.inf]])
    return section, MeasurementLimits(draw.period_s, draw.axes(1e-3), draw.axes(1e-3), ranges)


CASES = [
    (Governor, fill_governor, governor),
    (Prediction, fill_prediction, prediction),
    (FeedForward, fill_feed_forward, feed_forward),
    (Detector, fill_detector, detector),
    (Watchdog, fill_watchdog, watchdog),
]


def columns_of(values):
    """Return an argument of all rows from that of each."""
    if isinstance(values[0], BaseModel):
        return column_of(values)
    if hasattr(values[0], "_fields"):
        return type(values[0])(*map(column_of, zip(*values, strict=True)))
    return column_of(values)


@pytest.mark.parametrize(("kind", "fill", "arguments"), CASES, ids=[case[0].__name__ for case in CASES])
def test_every_row_is_that_of_one_controller(kind, fill, arguments):
    for block in range(BLOCKS):
        of_rows = [arguments(Draw(block, row)) for row in range(ROWS)]
        rows, shared = kind.zeros(ROWS, **SIZES), kind.zeros(ROWS, **SIZES)
        fill(rows, *map(columns_of, zip(*of_rows, strict=True)))
        fill(shared, *of_rows[0])
        ones = [kind.filled(fill, *each, **SIZES).tobytes() for each in of_rows]
        assert rows.tobytes() == b"".join(ones) != kind.zeros(ROWS, **SIZES).tobytes()
        assert shared.tobytes() == ROWS * ones[0]


@pytest.fixture
def magnetics(actuator):
    return torque_model(actuator)


def rows_of(magnetics, law, estimator, rows=ROWS):
    data = ControllerData.zeros(rows, delays=32, **magnetics.sizes)
    return controller(data, law, estimator, magnetics, 4.0)


@pytest.mark.parametrize("name", LAWS)
def test_every_controller_of_a_block_has_its_law_and_its_estimator(magnetics, name):
    known, sampling = NominalModel(1e-3, 1e-3, AXES), Sampling(1e-3, AXES, AXES)
    laws = [LAWS[name]().build(known._replace(inertia=(1 + row) * AXES)) for row in range(ROWS)]
    estimators = [ESTIMATORS["kalman"](bandwidth_rad_s=100.0 + row).build(sampling) for row in range(ROWS)]
    block = rows_of(magnetics, laws, estimators)
    for row in range(ROWS):
        alone = rows_of(magnetics, laws[row], estimators[row], rows=1)
        one, single = (uncompiled(controller_of)(*own) for own in ((alone, 0), (block, row)))
        for first, second in zip(one[:-1], single[:-1], strict=True):
            assert first.tobytes() == second.tobytes()
        assert all(array.flags.c_contiguous and array.ndim == 1 for array in single[1:-1])
    single.memory[:] = 7.0
    assert np.all(block.memory[-1] == 7.0)
    assert not np.any(laws[-1].state == 7.0)


def test_no_estimator_and_a_law_of_all_rows(magnetics):
    block = rows_of(magnetics, LAWS["pd"]().build(NominalModel(1e-3, 1e-3, AXES)), None)
    assert block.parameters.shape == (ROWS, 9)
    assert block.estimator_memory.shape == block.estimator_parameters.shape == (ROWS, 0)
    assert not block.data["estimator_on"].any()


def test_refuses_laws_of_several_kinds(magnetics):
    laws = [LAWS[name]().build(NominalModel(1e-3, 1e-3, AXES)) for name in ("pd", "pid")]
    with pytest.raises(MixedRowsError, match="kind of law"):
        rows_of(magnetics, laws, None, rows=2)
    estimators = [None, ESTIMATORS["kalman"]().build(Sampling(1e-3, AXES, AXES))]
    with pytest.raises(MixedRowsError, match="kind of estimator"):
        rows_of(magnetics, laws[0], estimators, rows=2)


def test_faulty_groups_are_marked_in_each_row():
    rows = EnabledGroups.zeros(2, groups=3)
    mark_faulty_groups(rows, np.array([[False, True, False], [True, False, False]]), np.float64(0.5))
    np.testing.assert_array_equal(rows["out"], [[0, REPORTED, 0], [REPORTED, 0, 0]])
    np.testing.assert_array_equal(rows["out_s"], [[0.0, 0.5, 0.0], [0.5, 0.0, 0.0]])


def test_no_manual_currents_are_none_at_each_time():
    assert sample_currents(ManualSection(), np.zeros(5)).shape == (5, 0)
    constant = sample_currents(ManualSection(currents_A=(0.5, -4.0)), np.array([0.0, 1e6]))
    np.testing.assert_array_equal(constant, [[0.5, -4.0]] * 2)
