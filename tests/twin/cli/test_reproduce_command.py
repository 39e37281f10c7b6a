"""``spheretwin reproduce``: its two streams, its exit codes, its page."""

import pytest

from spheretwin import cli
from spheretwin.cli import reproduce
from spheretwin.paper.experiment import Finding
from spheretwin.viz.terminal.texts import Verdict
from tests.twin.cli.calls import call, refusal, succeeded
from tests.twin.paper.cases import IDEAL, LOST, experiment


@pytest.fixture
def short(monkeypatch):
    """Add a short experiment of some cases."""

    def add(*cases):
        monkeypatch.setitem(reproduce.EXPERIMENTS, "short", experiment(*cases))

    return add


def test_the_page_states_the_command_with_all_options(tmp_path, short):
    short(IDEAL)
    options = ["--seeds", "1", "--limit", "3", "--plant", "lagrangian"]
    succeeded("reproduce", "short", *options, "--out", tmp_path)
    text = (tmp_path / "reproduce.md").read_text(encoding="utf-8")
    assert f"`{' '.join(['spheretwin', 'reproduce', 'short', *options])}`" in text


def test_people_get_tables(short):
    short(IDEAL)
    out = succeeded("reproduce", "short", "--seeds", "1", "--verbose")
    assert "short, What | was found. Errors" in out
    assert "ideal" in out


def test_a_verdict_for_each_experiment_fits_one_screen(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    results = [
        Finding(True, "the order holds" + " under every condition" * 9),
        Finding(False, "the size is 0.36 of the printed one"),
    ]
    names = [f"figure{number}" for number in range(10)]
    short = experiment(IDEAL, findings=lambda outcomes: results)
    monkeypatch.setattr(reproduce, "EXPERIMENTS", {name: short._replace(name=name) for name in names})
    lines = succeeded("reproduce", "all", "--seeds", "1").splitlines()
    assert 2 * len(names) < len(lines) <= 40
    assert max(map(len, lines)) <= 80
    assert [line for line in lines if line.startswith("figure")] == [
        f"{name}: 1 of 2 results reproduced. A short one" for name in names
    ]
    # The failed comparison comes first: it is never cut.
    after = [lines[place + 1] for place, line in enumerate(lines) if line.startswith("figure")]
    assert set(after) == {"  - not reproduced: the size is 0.36 of the printed one."}
    assert "Errors" not in "\n".join(lines)
    alone = " ".join(succeeded("reproduce", "figure3", "--seeds", "1").split())
    assert f"reproduced: {results[0].text}." in alone


@pytest.mark.parametrize(
    ("results", "verdict"),
    [([], "no verdict"), ([False], "not reproduced"), ([False, True, True], "2 of 3 results reproduced")],
)
def test_the_verdict_counts_the_results_of_the_paper(results, verdict):
    texts = [(result, "a") for result in results]
    assert Verdict("figure6", "Figure 6", texts).text().partition(":")[0] == verdict


def test_names_are_run_once_each_and_all_is_all(monkeypatch):
    experiments = {name: experiment(IDEAL)._replace(name=name) for name in "ab"}
    monkeypatch.setattr(reproduce, "EXPERIMENTS", experiments)
    for names in (["all"], ["b", "a", "b"]):
        result = call("reproduce", *names, "--json").json
        assert set(result) == {"rows", "seeds", "wall_s", "versions"}
        rows = result["rows"]
        assert [row["figure"] for row in rows] == ["a", "b"]


def test_a_run_that_ends_early_exits_1_and_is_named(short):
    short(IDEAL, LOST)
    result = call("reproduce", "short", "--json")
    assert result.code == cli.FAILED
    assert [row["status"] for row in result.json["rows"]] == ["completed", "left_workspace"]
    assert result.err == "spheretwin: reproduce: ended early: short: lost (left_workspace)\n"


def test_a_law_without_what_a_figure_varies_is_bad_input(tmp_path, short):
    short(IDEAL._replace(fields={"controller.law": "pd", "controller.surface_slope": 5.0}))
    message = refusal("reproduce", "short", "--out", tmp_path / "page")
    assert "reproduce short, ideal" in message
    assert "surface_slope" in message
    assert list(tmp_path.iterdir()) == []


def test_rows_run_on_the_plant_that_is_asked_for(short):
    short(IDEAL._replace(fields={"duration": 0.05}))
    for flags, plant in (([], "lagrangian"), (["--plant", "mujoco"], "mujoco")):
        (row,) = call("reproduce", "short", "--json", *flags).json["rows"]
        assert row["plant"] == plant
        assert f"--plant.engine {plant}" in row["command"]
