"""What is said of a study as a whole: its summary, what the worst goes with, its figures and its page."""

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from spheretwin.metrics import METRICS
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.fields import every_field, quantity_text, unit_of
from spheretwin.scenario.sections import Scenario
from spheretwin.study import conditions, report
from spheretwin.study.statistics import (
    StudyTable,
    interval,
    largest,
    quantile_text,
    ranked,
    read,
    share_interval,
    strongest,
    summary,
)
from tests.twin.study.cases import loads, run_rows, study

LISTS = st.none() | st.lists(st.none() | st.floats(-9, 9), min_size=1, max_size=3)


def made(count, figures, axes, laws=("pd",), lost=()):
    """Rows of a study that never ran."""
    statuses = np.full(count, "completed", dtype=object)
    statuses[list(lost)] = "left_workspace"
    listed = [{"field": field, "kind": "values"} for field in axes]
    fields = {"name": "made", "description": "It was made.", "axis": listed}
    texts, keys, named = np.full((3, count), "", dtype=object)
    keys[:] = [f"{place:016x}" for place in range(count)]
    named[:] = [laws[place % len(laws)] for place in range(count)]
    return StudyTable(fields, np.arange(count), keys, named, statuses, texts, axes, figures)


@given(st.lists(LISTS, max_size=8))
def test_the_largest_of_a_list_is_none_where_a_part_is(lists):
    column = pa.chunked_array([pa.array(part, pa.list_(pa.float64())) for part in (lists[:3], lists[3:])])
    expected = [np.nan if each is None or None in each else max(each) for each in lists]
    np.testing.assert_array_equal(largest(column), expected)


def test_the_summary_is_numpy_s_over_the_completed_rows_of_each_law():
    values_ = np.random.default_rng(0).normal(size=40)
    values_[6] = np.nan
    rows = made(40, {"max_abs_error_rad": values_}, {}, ("pd", "afsm"), lost=(0, 2, 3))
    summaries = summary(rows)
    assert summaries["pd"]["statuses"] == {"left_workspace": 2, "completed": 18}
    of_pd = [values_[place] for place in range(4, 40, 2) if place != 6]
    low, median, high = np.percentile(of_pd, [2.5, 50, 97.5])
    # Of 17 values: P(5 to 12 of 17 tosses are heads) = 0.951.
    inner = sorted(of_pd)[4], sorted(of_pd)[12]
    assert summaries["pd"]["max_abs_error_rad"] == {
        "median": median,
        "median_95": list(inner),
        "range_95": [low, high],
    }
    lost = made(2, {"max_abs_error_rad": np.ones(2)}, {}, lost=(0, 1))
    assert summary(lost)["pd"]["max_abs_error_rad"] == {"median": None, "median_95": None, "range_95": None}


def test_an_interval_is_that_of_many_resamples():
    values = np.random.default_rng(3).exponential(size=400)
    resamples = np.random.default_rng(4).choice(values, (20_000, 400))
    for share in (0.5, 0.9):
        quantiles = np.quantile(resamples, share, axis=1, method="inverted_cdf")
        # Both ends are values of the sample: those of the resamples are at most a rank away.
        ends = np.searchsorted(
            np.sort(values), [interval(values, share), np.quantile(quantiles, [0.025, 0.975])]
        )
        assert np.abs(np.diff(ends, axis=0)).max() <= 1


@pytest.mark.parametrize(("count", "share"), [(20, 0.5), (100, 0.5), (100, 0.9), (400, 0.95)])
def test_an_interval_covers_the_quantile_in_95_of_100_samples(count, share):
    samples = np.random.default_rng(5).uniform(size=(1000, count))
    covered = np.mean([low <= share <= high for low, high in (interval(sample, share) for sample in samples)])
    # Ranks are coarse; three standard deviations of 1,000 samples are 0.02.
    assert 0.91 < covered < 0.98


def test_the_interval_of_a_share_is_scipy_s():
    for cases, draws in ((3, 100), (0, 20), (20, 20)):
        expected = stats.binomtest(cases, draws).proportion_ci()
        np.testing.assert_allclose(share_interval(cases, draws), (expected.low, expected.high), atol=1e-9)


def test_an_interval_has_its_special_cases():
    assert interval([2.0]) == interval([1.0] * 5) == (-np.inf, np.inf)  # each may be above the median: 3 %
    assert interval([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) == (1.0, 6.0)
    assert (
        interval(np.arange(100.0), 0.99)[1] == np.inf
    )  # 100 draws are below the quantile in 37 % of samples
    assert interval([1.0] * 80 + [np.inf] * 20, 0.95) == (np.inf, np.inf)
    assert interval([1.0] * 90 + [np.inf] * 10, 0.9) == (1.0, np.inf)
    assert np.isnan(interval([])).all()
    assert np.isnan(interval([1.0, np.nan])).all()
    values = np.arange(400.0)
    assert interval(values) == (179.0, 220.0)  # P(180 to 220 of 400 tosses are heads) = 0.960
    low, high = interval(values, draws=100)  # four values a draw: twice as wide
    assert 2 * 41 - 4 <= high - low <= 2 * 41 + 4


def test_the_text_of_a_quantile_has_no_end_that_the_draws_do_not_give():
    assert quantile_text([1.0, 2.0], "{:.1f}".format) == "1.5 [–, –]"
    assert quantile_text(np.arange(100.0), "{:g}".format, 0.99) == "98 [94, –]"
    assert quantile_text([1.0] * 50 + [np.inf] * 50, "{:g}".format, 0.9) == "inf [inf, inf]"
    assert quantile_text([], str) == quantile_text([1.0, np.nan], str) == "–"


def test_rank_correlations_are_scipy_s_where_rows_are_few():
    x = np.random.default_rng(1).normal(size=(3, 20))
    y = x[0] + 0.5 * np.abs(x[1])
    rank = ranked(list(x), y)
    assert not rank.is_partial
    assert rank.chance == 1.96 / np.sqrt(20 - 1)
    # The same sums in another order.
    np.testing.assert_allclose(rank.by_value, [stats.spearmanr(each, y).statistic for each in x], atol=1e-14)


def test_what_is_partial_is_the_correlation_of_what_fits_of_the_others_leave():
    x = np.random.default_rng(2).normal(size=(3, 200))
    y = 9 * x[0] + x[1] + np.abs(x[2])
    rank = ranked(list(x), y)
    assert rank.is_partial
    assert rank.chance == 1.96 / np.sqrt(200 - 7)  # three values, three distances and the figure
    columns = np.stack([stats.rankdata(each) for each in (*x, *(np.abs(a - np.median(a)) for a in x))])
    for place in range(6):
        others = np.vstack([np.delete(columns, place, axis=0), np.ones(200)]).T
        both = (columns[place], stats.rankdata(y))
        left = [each - others @ np.linalg.lstsq(others, each)[0] for each in both]
        # Two ways to solve systems whose condition is some tens.
        partial = pytest.approx(np.corrcoef(left)[0, 1], abs=1e-9)
        assert [*rank.by_value, *rank.by_distance][place] == partial
    # Behind the first, which outweighs them, the others show: by value, and by distance alone.
    assert rank.by_value[1] > 3 * rank.chance
    assert rank.by_distance[2] > 3 * rank.chance
    assert rank.by_distance[2] > abs(rank.by_value[2])
    assert strongest([rank])[0] == 0


def test_axes_that_go_together_or_do_not_differ_are_ranked_plainly():
    x = np.random.default_rng(3).normal(size=100)
    rank = ranked([x, 2 * x, np.ones(100)], x)
    assert not rank.is_partial
    # Sums of a hundred products.
    np.testing.assert_allclose(rank.by_value, [1, 1, 0], atol=1e-13)


def test_what_does_not_matter_is_by_chance_95_times_of_a_hundred():
    generator = np.random.default_rng(4)
    rank = ranked(list(generator.normal(size=(200, 2000))), generator.normal(size=2000))
    inside = np.mean(np.abs([*rank.by_value, *rank.by_distance]) <= rank.chance)
    # Of 400, each with 0.05: 3.5 deviations of a binomial.
    assert inside == pytest.approx(0.95, abs=3.5 * np.sqrt(0.05 * 0.95 / 400))


NUMBERS = np.linspace(0, 1, 24)


@pytest.mark.parametrize("lost", [range(24), range(23)])
def test_where_hardly_a_row_was_completed_nothing_fails(tmp_path, lost):
    rows = made(24, {"max_abs_error_rad": NUMBERS}, {"a": NUMBERS, "b": NUMBERS, "c": NUMBERS}, lost=lost)
    assert len(report.write(tmp_path, rows, summary(rows), (24, 24), "made")) == 2
    assert "| pd | left_workspace |" in (tmp_path / "report.md").read_text()


def test_a_study_of_one_row_has_a_page(tmp_path):
    run_rows(study(), tmp_path)
    rows = read(tmp_path / "table.parquet")
    report.write(tmp_path, rows, summary(rows), (1, 1), "short")
    assert "Only the seed differs." in (tmp_path / "report.md").read_text()


def test_a_damaged_table_is_refused_with_its_place(tmp_path):
    run_rows(loads(), tmp_path)
    path = tmp_path / "table.parquet"
    content = path.read_bytes()
    assert len(read(path).numbers) == 24
    message = r"(row group 0, rows 0 to 23|the footer).*: the file is damaged|magic"
    for bit in np.random.default_rng(0).integers(8 * len(content), size=40).tolist():
        damaged = bytearray(content)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=message):
            read(path)


def test_failures_are_rows_that_a_watchdog_ended_or_in_which_user_code_raised():
    rows = made(6, {"max_abs_error_rad": np.ones(6)}, {}, lost=(1,))
    rows.statuses[2:4] = ["failsafe", "failed"]
    rows.complaints[[1, 4]] = ["end of the range", "the metric raised"]
    assert rows.failures.tolist() == [2, 3, 4]


def test_words_of_all_fields_and_metrics_are_different_and_end_in_their_units():
    names = {name for name, _ in every_field(Scenario)} | set(METRICS)
    words = {name: quantity_text(name) for name in names}
    assert len(set(words.values())) == len(names)
    assert not any("_" in text or "." in text for text in words.values())
    assert all(text.endswith(f", {unit_of(name)}") for name, text in words.items() if unit_of(name))


def test_medians_by_condition_are_those_of_each_hinge(tmp_path):
    """The encoder of γ may have the largest error of all rows."""
    errors_deg = np.random.default_rng(6).uniform(1, 2, (40, 3)) * [1.0, 1.0, 9.0]
    delays = np.repeat([1e-3, 2e-3], 20)
    rows = made(
        40, {"max_abs_error_rad": np.radians(errors_deg).max(axis=1)}, {"drive.delay_s": delays}, lost=[3]
    )
    rows = rows._replace(hinges_rad=np.radians(errors_deg))
    lines = conditions.section(rows)[0].lines()
    first, second = (line.split("|")[1:-1] for line in lines if "of 20" in line)
    assert [cell.strip() for cell in first[:3]] == ["0.001", "pd", "19 of 20"]
    # The medians are of 19 and 20 numbers from 17.5 to 34.9 mrad: their intervals are wider than 5 mrad.
    worse_mrad = 1e3 * np.radians(np.delete(errors_deg[:20, :2].max(axis=1), 3))
    assert first[6].strip() == quantile_text(worse_mrad, "{:.1f}".format)
    beta_mrad = 1e3 * np.radians(errors_deg[20:, 1])
    assert second[4].strip() == quantile_text(beta_mrad, "{:.1f}".format)
    tilt = summary(rows)["pd"]["max_abs_tilt_error_rad"]["median"]  # without γ, also in the printed table
    assert tilt == pytest.approx(np.median(np.radians(np.delete(errors_deg, 3, 0)[:, :2].max(axis=1))))
    assert summary(rows)["pd"]["max_abs_error_rad"]["median"] > 3 * tilt
    assert [row[0] for row in report.medians(summary(rows)).rows[1:2]] == ["largest tilt error, mrad"]
    assert (
        conditions.section(made(2, {"max_abs_error_rad": np.ones(2)}, {"drive.delay_s": delays[19:21]})) == []
    )
