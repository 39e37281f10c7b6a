"""Progress of a run on stderr: how far, how fast, how long still."""

from __future__ import annotations

from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars

from spheretwin.models.telemetry.table import Table


class Progress:
    """A progress bar that counts control ticks; silent where stderr is no terminal."""

    def __init__(self, name: str, ticks: int) -> None:
        console = Console(stderr=True)
        self._name = name
        self._bars = Bars(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("{task.fields[simulated_s]:.2f} s simulated"),
            TimeRemainingColumn(),
            console=console,
            disable=not console.is_terminal,
        )
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
        """Nothing is shown of it."""

    def finish(self, status: str) -> None:
        """Show how the run ended."""
        self._bars.update(self._task, description=f"{self._name}: {status}")
