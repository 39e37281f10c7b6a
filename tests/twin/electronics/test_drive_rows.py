"""Set-up of many drives at once: every row is that of a single one."""

import numpy as np
import pytest

from spheretwin.electronics.coil_coupling import check_coupling
from spheretwin.electronics.delay import DelaySection, steps_of
from spheretwin.electronics.drive_chain import DriveChain, fill_drive, stored_delays
from spheretwin.electronics.drive_section import ResolvedDrive, drive_sheet
from spheretwin.models.base.columns import Columns, column_of
from spheretwin.models.base.errors import InputError

pytestmark = pytest.mark.uncompiled

ROWS, GROUPS, STEP_S = 5, 4, 5e-4
SIZES = {"groups": GROUPS, "delays": 32}
MUTUAL_H = 1e-5 * (1 - np.eye(GROUPS)) * np.add.outer(np.arange(GROUPS), np.arange(GROUPS))
PER_GROUP = {
    "resistance_ohm": (1.0, 2.0),
    "inductance_H": (1e-3, 2e-3),
    "resistance_per_K": (0.0, 0.01),
    "heat_capacity_J_K": (30.0, 90.0),
    "thermal_resistance_K_W": (1.0, 5.0),
    "shutdown_degC": (100.0, 200.0),
}
COMMON = {
    "current_limit_A": (5.0, 9.0),
    "ambient_degC": (-20.0, 60.0),
    "transconductance_A_V": (0.5, 1.0),
    "amplifier_offset_V": (-0.1, 0.1),
    "dac_range_V": (5.0, 15.0),
    "dac_offset_V": (0.0, 0.01),
    "dac_gain_error": (0.0, 0.01),
    "dac_inl_lsb": (0.0, 9.0),
}
SUPPLY = {
    "supply_V": (10.0, 30.0),
    "drop_up_V": (0.0, 5.0),
    "drop_down_V": (0.0, 5.0),
    "bandwidth_rad_s": (1e3, 1e5),
    "coil_coupling": (-1.0, 1.0),
}
LAG = {"time_constant_s": (-1e-3, 1e-2)}


def random_sections(generator, supplied):
    """Sections that differ in all numbers; a negative one is 0, a number of a group is one of all or not."""
    of_groups = PER_GROUP if supplied else PER_GROUP | LAG
    common = COMMON | SUPPLY if supplied else COMMON
    sections = []
    for _ in range(ROWS):
        fields = {name: max(generator.uniform(*ends), 0.0) for name, ends in (of_groups | common).items()}
        for name, ends in of_groups.items():
            if generator.random() < 0.2:
                fields[name] = tuple(np.maximum(generator.uniform(*ends, GROUPS), 0.0).tolist())
        bits, steps = generator.integers(0, 20), generator.integers(0, 9)
        sections.append(ResolvedDrive(**fields, dac_bits=int(bits) % 17, delay_s=float(steps * STEP_S)))
    return sections


def single(section, step_s, substeps, seed, faulty, halts):
    mutual_H = MUTUAL_H if section.coil_coupling else None
    setting = section, step_s, substeps, seed, faulty, halts, mutual_H
    return DriveChain.filled(fill_drive, *setting, **SIZES)


@pytest.mark.parametrize("supplied", [True, False])
@pytest.mark.parametrize("start", range(8))
def test_every_row_is_that_of_a_single_drive(supplied, start):
    generator = np.random.default_rng(start)
    sections = random_sections(generator, supplied)
    step_s, seeds = (
        (0.5 ** generator.integers(0, 2, ROWS) * STEP_S).tolist(),
        list(range(start, start + ROWS)),
    )
    substeps, faulty, halts = (generator.integers(low, 3, ROWS).tolist() for low in (1, 0, 0))
    settings = step_s, substeps, seeds, [bool(x) for x in faulty], [bool(x) for x in halts]
    rows = DriveChain.zeros(ROWS, **SIZES)
    fill_drive(rows, Columns(sections), *map(column_of, settings), MUTUAL_H if supplied else None)
    singles = [single(*row) for row in zip(sections, *settings, strict=True)]
    assert rows.tobytes() == b"".join(row.tobytes() for row in singles)


@pytest.mark.parametrize("supplied", [True, False])
def test_rows_may_share_a_section(supplied):
    section = random_sections(np.random.default_rng(1), supplied)[0]
    settings, seeds = (STEP_S, 2), [3, 4, 5]
    rows, mutual_H = DriveChain.zeros(3, **SIZES), MUTUAL_H if section.coil_coupling else None
    fill_drive(rows, section, *settings, column_of(seeds), True, False, mutual_H)
    singles = [single(section, *settings, seed, True, False) for seed in seeds]
    assert rows.tobytes() == b"".join(row.tobytes() for row in singles)


@pytest.mark.parametrize("supplied", [True, False])
def test_sheets_of_all_rows(supplied):
    sections = random_sections(np.random.default_rng(2), supplied)
    for name, column in drive_sheet(Columns(sections)).items():
        for row, section in enumerate(sections):
            values = column[row] if isinstance(column, np.ndarray) else column
            np.testing.assert_array_equal(values, drive_sheet(section)[name], strict=False)


def test_histories_hold_the_longest_delay():
    delays_s = [0.0, 100 * STEP_S, 3 * STEP_S]
    columns = Columns([DelaySection(delay_s=delay_s) for delay_s in delays_s])
    np.testing.assert_array_equal(steps_of(columns, STEP_S, 2), [[0], [100], [3]])
    assert stored_delays(columns, STEP_S, 2) == 64
    assert stored_delays(columns, STEP_S, np.array([[2], [1], [2]]), 28) == 256


def test_the_message_is_that_of_the_first_wrong_row():
    delays = Columns([DelaySection(delay_s=delay_s) for delay_s in (0.0, 7e-4, 1e-7)])
    with pytest.raises(ValueError, match=r"received 0\.0007 and 0\.0005 s"):
        steps_of(delays, STEP_S, 2)
    sections = random_sections(np.random.default_rng(4), True)
    wrong = [one.model_copy(update={"coil_coupling": 1.0, "inductance_H": 1e-6}) for one in sections[:2]]
    with pytest.raises(InputError) as of_one:
        check_coupling(wrong[0], MUTUAL_H)
    with pytest.raises(InputError) as of_many:
        check_coupling(Columns([*sections, *wrong]), MUTUAL_H)
    assert str(of_many.value) == str(of_one.value)
