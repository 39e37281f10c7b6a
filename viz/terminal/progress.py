"""Progress on stderr: how far, how long still; silent where stderr is no terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, ProgressColumn, Task, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars
from rich.text import Text

from spheretwin.models.telemetry.table import Table


def tracked(label: str) -> Callable[[range], Iterable[int]]:
    """Return a progress bar for a range of steps; it disappears at the end."""

    def followed(steps: range) -> Iterator[int]:
        with _bars(transient=True) as bars:
            yield from bars.track(steps, description=label)

    return followed


@contextmanager
def parts(label: str, count: int) -> Iterator[Callable[[str], None]]:
    """Yield a function that shows the name of each part as it begins; the bar disappears at the end."""
    with _bars(transient=True) as bars:
        task = bars.add_task(label, total=count, completed=-1)  # the first part follows none
        yield lambda name: bars.update(task, description=name, advance=1)


@contextmanager
def runs(label: str, count: int) -> Iterator[Callable[[str], None]]:
    """Yield a function that shows the name of each run when it is done; the bar disappears at the end."""
    with _bars(transient=True) as bars:
        task = bars.add_task(f"{label}: getting ready", total=count)
        yield lambda name: bars.update(task, description=f"{label}, {name}", advance=1)


@contextmanager
def counted(label: str, what: str = "rows") -> Iterator[Callable[[int, int], None]]:
    """Yield a function that shows the completed number and the total; the bar disappears at the end."""
    with _bars(_Rate(what), transient=True) as bars:
        task = bars.add_task(f"{label}: getting ready", total=None)
        before: list[int] = []  # completed earlier, which is reported first: the rest has yet to start

        def update(done: int, of: int) -> None:
            if not before:
                before.append(done)
            named = label if done > before[0] else f"{label}: getting ready"
            bars.update(task, description=named, completed=done, total=of)

        yield update


class _Rate(ProgressColumn):
    """Rate for each second."""

    def __init__(self, what: str) -> None:
        super().__init__()
        self._what = what

    def render(self, task: Task) -> Text:
        if task.speed is None:
            return Text("")
        figure = f"{task.speed:.0f}" if task.speed >= 10 else f"{task.speed:.2g}"
        return Text(f"{figure} {self._what}/s")


class Progress:
    """Progress bar for the control ticks of a run, which remains and shows its status."""

    def __init__(self, name: str, ticks: int) -> None:
        self._name = name
        self._bars = _bars(TextColumn("{task.fields[simulated_s]:.2f} s simulated"))
        self._task = self._bars.add_task(f"{name}: getting ready", total=ticks, simulated_s=0.0)

    def __enter__(self) -> Progress:
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bars.stop()

    def write(self, rows: Table) -> None:
        """Count the rows of one chunk."""
        if len(rows):
            simulated_s = rows["t_s"][-1]
            self._bars.update(self._task, advance=len(rows), simulated_s=simulated_s, description=self._name)

    def note(self, t_s: float, text: str) -> None:
        """Ignore notes."""

    def finish(self, status: str) -> None:
        """Show how the run ended."""
        self._bars.update(self._task, description=f"{self._name}: {status}")


def _bars(*more: ProgressColumn, transient: bool = False) -> Bars:
    """Return bars with description, share, other columns, and the remaining time."""
    console = Console(stderr=True)
    return Bars(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        *more,
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,
        transient=transient,
    )
