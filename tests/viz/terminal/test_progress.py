"""Progress: one style for runs, steps and parts; nothing without a terminal."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from spheretwin.viz.terminal import progress
from spheretwin.viz.terminal.progress import Progress, counted, parts, runs, tracked

ESCAPES = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")
LOOK = r"{} +[━╸╺]+ +100% {}0:00:00"


def follow_steps():
    assert list(tracked("direct sums")(range(4))) == [0, 1, 2, 3]


def follow_parts():
    with parts("crosscheck", 2) as begun:
        begun("dynamics")
        begun("closed loop")


def follow_runs():
    with runs("reproduce", 2) as done:
        done("pd: ideal")
        done("pd: all")


class Chunk(SimpleNamespace):
    def __len__(self):
        return len(self.t_s)

    def __getitem__(self, name):
        return getattr(self, name)


def follow_a_run():
    with Progress("hold", 100) as bar:
        bar.write(Chunk(t_s=np.array([])))
        bar.write(Chunk(t_s=np.arange(100) / 50))
        bar.note(1.0, "saturation begins")
        bar.finish("completed")


def follow_rows():
    with counted("short", "trials") as done:
        for finished in (2, 3, 4):
            done(finished, 4)


@pytest.mark.parametrize("follow", [follow_steps, follow_parts, follow_runs, follow_a_run, follow_rows])
def test_nothing_is_printed_where_stderr_is_no_terminal(capsys, follow):
    follow()
    assert capsys.readouterr() == ("", "")


@pytest.fixture
def watched(monkeypatch):
    """A terminal on stderr, as rich is told of one."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setenv("TERM", "xterm")


@pytest.mark.usefixtures("watched")
@pytest.mark.parametrize(
    ("follow", "name", "more"),
    [
        (follow_steps, "direct sums", ""),
        (follow_runs, "reproduce, pd: all", ""),
        (follow_a_run, "hold: completed", "1.98 s simulated "),
        (follow_rows, "short", r"\S* *\S* *"),
    ],
)
def test_a_terminal_shows_name_share_and_time(capsys, follow, name, more):
    follow()
    out, err = capsys.readouterr()
    assert out == ""
    last = re.split(r"[\r\n]+", ESCAPES.sub("", err).rstrip())[-1]
    assert re.search(LOOK.format(name, more), last)


@pytest.mark.usefixtures("watched")
def test_parts_are_counted_as_they_begin(capsys):
    follow_parts()
    lines = re.split(r"[\r\n]+", ESCAPES.sub("", capsys.readouterr().err))
    *_, last = (line for line in lines if "%" in line)
    # The last to begin has half the parts behind it, and is not done.
    assert (re.split(" [━╸]", last)[0], re.search(r"(\d+)%", last)[1]) == ("closed loop", "50")


@pytest.mark.parametrize(
    ("speed", "text"),
    [(None, ""), (0.123, "0.12 rows/s"), (9.96, "10 rows/s"), (10.0, "10 rows/s"), (1234.5, "1234 rows/s")],
)
def test_a_rate_has_two_digits_or_is_whole(speed, text):
    assert progress._Rate("rows").render(SimpleNamespace(speed=speed)).plain == text


@pytest.fixture
def state(monkeypatch):
    """Description, total and completed steps of the task of the latest bars, and its own fields."""
    made, bars = [], progress._bars
    monkeypatch.setattr(
        progress, "_bars", lambda *more, **given: made.append(bars(*more, **given)) or made[-1]
    )

    def of_task():
        (task,) = made[-1].tasks
        return task.description, task.total, task.completed, task.fields

    return of_task


def test_rows_of_earlier_runs_are_counted_but_are_no_start(state):
    with counted("short") as done:
        assert state() == ("short: getting ready", None, 0, {})
        for finished, name in ((2, "short: getting ready"), (3, "short"), (4, "short")):
            done(finished, 4)
            assert state() == (name, 4, finished, {})


def test_a_run_is_named_alone_once_it_has_begun(state):
    with Progress("hold", 100) as bar:
        bar.write(Chunk(t_s=np.array([])))
        assert state() == ("hold: getting ready", 100, 0, {"simulated_s": 0.0})
        bar.write(Chunk(t_s=np.arange(20) / 50))
        assert state() == ("hold", 100, 20, {"simulated_s": 0.38})
        bar.finish("interrupted")
        assert state()[:3] == ("hold: interrupted", 100, 20)
