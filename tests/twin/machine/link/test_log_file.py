"""Log of a run on a machine: it is read without a column map."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from spheretwin import machine
from spheretwin.machine.export import LogFile
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table

RANDOM = np.random.default_rng(0)
TIMES, ANGLES, CURRENTS = 1e-3 * np.arange(20), RANDOM.normal(size=(20, 3)), RANDOM.normal(size=(20, 18))
SIGNALS = (Signal("t_s", "s", 1, ""), Signal("q_rad", "rad", 3, ""), Signal("current_A", "A", 18, ""))


@pytest.mark.parametrize("conditions", [{}, {"plant.payload_kg": 0.05}])
def test_the_log_of_a_drive_is_read_without_a_column_map(conditions, tmp_path):
    file = LogFile(tmp_path / "log.parquet", {3, 17}, 1e-3, conditions)
    rows = Table(SIGNALS, np.column_stack([TIMES, ANGLES, CURRENTS]))
    for first in (0, 8):
        file.write(rows.rows(first, first + 8 if not first else 20))
    file.close()
    log = machine.read(tmp_path / "log.parquet")
    assert np.flatnonzero(np.isnan(log.angle_rad[:, 0])).tolist() == [3, 17]
    assert np.array_equal(np.delete(log.angle_rad, [3, 17], axis=0), np.delete(ANGLES, [3, 17], axis=0))
    assert np.array_equal(log.current_A, CURRENTS)
    assert (log.currents, log.conditions, log.notes) == ("commanded", conditions, ())


def test_a_log_of_an_earlier_version_is_read_without_a_column_map(tmp_path):
    columns = {"t_s": pa.array(TIMES)}
    for name, values in (("current_A", CURRENTS), ("angle_rad", ANGLES)):
        columns[name] = pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])
    table = pa.table(columns).replace_schema_metadata({"currents": "commanded"})
    pyarrow.parquet.write_table(table, path := tmp_path / "log.parquet")
    assert np.array_equal(machine.read(path).current_A, CURRENTS)
    assert np.array_equal(machine.read(path).angle_rad, ANGLES)


def test_no_file_without_a_tick(tmp_path):
    LogFile(tmp_path / "log.parquet", (), 1e-3, {}).close()
    assert not list(tmp_path.iterdir())
