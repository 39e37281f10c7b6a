"""File of a twin: its digest, and how a file without one is accepted."""

import random
import re
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy.stats import norm

from spheretwin.machine import Log
from spheretwin.machine.identification import Identified, IdentifiedValue
from spheretwin.machine.twin_file import (
    UNSIGNED,
    history_drawing,
    read_drifts,
    read_history,
    read_twin,
    read_uncertainty,
    write_twin,
)
from spheretwin.machine.validation import ResidualFit
from spheretwin.models.base.errors import InputError

FIELDS = {"plant.coulomb_Nm": [0.003, 0.003, 0.004], "plant.modelling_error": 0.1}
FIT = ResidualFit(1.0, {}, ())
RESULT = Identified(
    accepted=True,
    parameters={"torque_scale": IdentifiedValue(0.97, (0.96, 0.98), "1")},
    refused=(), correlations=(), train=FIT, held_out=FIT, held_out_before=FIT, improvement=0.5,
    covariance=np.array([[2.5e-5]]),
    fields=FIELDS,
)  # fmt: skip
LOG = Log([0.0, 1.0], np.zeros((2, 18)), np.zeros((2, 3)), name="log.csv")


@pytest.fixture
def path(tmp_path):
    write_twin(path := tmp_path / "twin.toml", RESULT, "hold", {"plant.payload_kg": 0.05}, [LOG])
    return path


def test_each_changed_character_and_each_cut_is_refused_by_name(path):
    text, draws = path.read_text(), random.Random(43)
    assert LOG.digest in text
    digits = [match.start() for match in re.finditer(r"\d", text)]
    assert len(digits) > 100
    for place in digits:
        wrong = f"{text[:place]}{(int(text[place]) + 1) % 10}{text[place + 1 :]}"
        path.write_text(wrong)
        with pytest.raises(InputError, match=r"twin .*twin\.toml: expected (sha256|format)"):
            read_twin(path)
    for _ in range(300):  # line breaks at the end are no content
        place, content = draws.randrange(len(text.rstrip("\n"))), bytearray(text.encode())
        content[place] ^= 1 << draws.randrange(8)
        for wrong in (content, content[:place]):
            path.write_bytes(wrong)
            with pytest.raises(InputError, match=r"twin .*twin\.toml: expected"):
                read_twin(path)


def test_only_an_accepted_result_is_written_and_only_this_format_is_read(path):
    with pytest.raises(InputError, match="expected an accepted identification"):
        write_twin(path, RESULT._replace(accepted=False, shortcomings=("why",)), "hold", {}, [LOG])
    path.write_text("format = 2")
    with pytest.raises(InputError, match=r"expected format = 1 and a table \[fields\], received format 2"):
        read_twin(path)


def test_the_history_of_a_twin_goes_on_and_its_drift_is_the_weighted_slope(tmp_path):
    path, start = tmp_path / "twin.toml", datetime(2026, 1, 5, tzinfo=UTC)
    days, values, halves = np.array([0.0, 1.5, 4.0]), [0.97, 0.955, 0.94], np.array([0.01, 0.02, 0.01])
    path.write_text("format = 2")  # no twin: it is overwritten
    for day, value, half in zip(days, values, halves, strict=True):
        parameters = {"torque_scale": IdentifiedValue(value, (value - half, value + half), "1")}
        result = RESULT._replace(parameters=parameters)
        write_twin(path, result, "hold", {}, [LOG], start + timedelta(days=day))
    history = read_history(path)
    assert [one.values["torque_scale"][0] for one in history] == values
    drift, deviations = read_drifts(path)["torque_scale"], halves / norm.isf(0.025)
    (slope, _), covariance = np.polyfit(days, values, 1, w=1 / deviations, cov="unscaled")
    assert drift[:2] == pytest.approx((slope, norm.isf(0.025) * covariance[0, 0] ** 0.5), rel=1e-6)
    assert drift.is_clear
    assert drift.text() == "-0.0074 ± 0.0035/day"
    lines = history_drawing(history).figure.axes[0].lines
    np.testing.assert_allclose(lines[0].get_xdata(), days)
    np.testing.assert_allclose(lines[0].get_ydata(), (np.array(values) - 0.97) / halves.mean(), rtol=1e-9)
    path.write_text(f'format = 1\n{UNSIGNED}\n[fields]\n[[history]]\ndate = "yesterday"')
    with pytest.raises(InputError, match=r"expected \[\[history\]\] with a date"):
        read_history(path)


def test_line_breaks_of_another_system_are_no_change(path):
    text = path.read_text()
    path.write_bytes(b"\xef\xbb\xbf" + text.rstrip("\n").replace("\n", "\r\n").encode())
    assert read_twin(path) == {"plant.payload_kg": 0.05, **FIELDS}
    assert read_uncertainty(path).names == ("torque_scale",)


@pytest.mark.parametrize("line", ["", "sha256 = 5", 'sha256 = ["unchecked"]', 'sha256 = "Unchecked"'])
def test_the_line_that_accepts_an_edited_file_or_one_of_an_earlier_version(path, line):
    edited = path.read_text().replace("0.004", "0.005")
    path.write_text(re.sub("^sha256 = .*$", line, edited, count=1, flags=re.MULTILINE))
    with pytest.raises(InputError, match=f"the line {UNSIGNED} accepts a file as it is"):
        read_twin(path)
    path.write_text(re.sub("^sha256 = .*$", UNSIGNED, edited, count=1, flags=re.MULTILINE))
    assert read_twin(path)["plant.coulomb_Nm"] == [0.003, 0.003, 0.005]


def test_a_learned_torque_is_stored_next_to_the_twin(tmp_path):
    (tmp_path / "elsewhere.npz").write_bytes(content := b"arrays")
    learned = {
        "plant.learned_torque.file": str(tmp_path / "elsewhere.npz"),
        "plant.learned_torque.sha256": "0",
    }
    (tmp_path / "other").mkdir()
    write_twin(path := tmp_path / "other" / "twin.toml", RESULT, "hold", learned, [LOG])
    assert '"plant.learned_torque.file" = "twin.learned.npz"' in path.read_text()
    (tmp_path / "other").rename(tmp_path / "moved")
    fields = read_twin(tmp_path / "moved" / "twin.toml")
    assert fields["plant.learned_torque.file"] == str(tmp_path / "moved" / "twin.learned.npz")
    assert (tmp_path / "moved" / "twin.learned.npz").read_bytes() == content
