"""Sensors of many rows: each row has the bytes of its own set-up."""

import numpy as np
import pytest

from spheretwin.electronics.sensor_chain import (
    SensorChain,
    SensorsSection,
    fill_sensors,
    noise_streams,
    sensor_sheet,
)
from spheretwin.models.base.columns import Columns, MixedRowsError

pytestmark = pytest.mark.uncompiled
ROWS = 5


def random_section(random, on):
    """Section of which every number is random; those of noise are 0 unless `on`, others are 0 at times."""

    def size(bound, kept=None):
        kept = random.random() < 0.7 if kept is None else kept
        return kept * random.uniform(1e-3, bound)

    track_rad, play_rad, counts = random.uniform(0.1, 10), random.uniform(2e-3, 0.9), random.integers(0, 5000)
    return SensorsSection(
        angle_offset_rad=tuple(size(1.0) for _ in range(3)),
        potentiometer={
            "electrical_angle_rad": track_rad,
            "supply_V": size(20.0, True),
            "nonlinearity_rad": size(0.05 * track_rad),
            "noise_rad": size(0.01, on),
            "hysteresis_rad": size(1.0) if not on else play_rad,
            "repeatability_rad": on * play_rad / 2,
        },
        adc={
            "bits": int(random.integers(0, 33)),
            "range_V": size(10.0, True),
            "offset_V": size(1.0),
            "gain_error": size(0.5),
            "noise_V": size(0.1, on),
            "oversampling": 3,
            "skew_s": size(2e-3),
        },
        encoder={
            "counts": int(counts),
            "eccentricity_rad": size(0.5),
            "start_error_rad": size(3.0) * bool(counts),
            "index_rad": random.uniform(-3, 3),
        },
    )


def together(section, seed):
    rows = SensorChain.zeros(ROWS, delays=8)
    fill_sensors(rows, section, seed, faults=False)
    return rows.tobytes()


def alone(sections, seeds):
    rows = [SensorChain.filled(fill_sensors, *one, delays=8) for one in zip(sections, seeds, strict=True)]
    return np.concatenate(rows).tobytes()


@pytest.mark.parametrize("case", range(40))
def test_rows_have_the_bytes_of_single_runs(case):
    random = np.random.default_rng(case)
    sections = [random_section(random, case % 2) for _ in range(ROWS)]
    seeds = random.integers(0, 2**40, ROWS)
    columns = Columns(sections)
    assert together(columns, seeds[:, None]) == alone(sections, seeds.tolist())
    assert together(columns, 7) == alone(sections, [7] * ROWS)
    assert together(sections[0], seeds[:, None]) == alone(sections[:1] * ROWS, seeds.tolist())
    assert together(sections[0], 7) == alone(sections[:1] * ROWS, [7] * ROWS)
    assert noise_streams(columns) == noise_streams(sections[0])


def test_data_sheets_of_rows():
    random = np.random.default_rng(3)
    sections = [random_section(random, True) for _ in range(ROWS)]
    sheet, single = sensor_sheet(Columns(sections)), [sensor_sheet(section) for section in sections]
    for name in ("angle_noise_rad", "angle_resolution_rad"):
        np.testing.assert_array_equal(sheet[name], [one[name] for one in single])
    assert sheet["current_noise_A"] == 0


def test_rows_with_other_numbers_of_draws_are_refused():
    sections = Columns([SensorsSection(adc={"noise_V": noise_V}) for noise_V in (0.0, 0.1)])
    for use in (noise_streams, lambda section: fill_sensors(SensorChain.zeros(2, delays=8), section, 0)):
        with pytest.raises(MixedRowsError, match="as many random numbers of the sensors in all rows"):
            use(sections)
