"""What an engine of a sweep is: it runs rows wherever it can, and hands over each as it is finished."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from typing import NamedTuple

from spheretwin.twin.study.engines.work import Work
from spheretwin.twin.study.grid import Grid, Row
from spheretwin.twin.study.row import Result


class Order(NamedTuple):
    """What an engine is asked for.

    Attributes
    ----------
    numbers : iterator of int
        Of the rows to run.
    rows : int
        How many these are.
    grid : Grid
        Of the study.
    work : Work
        Runs a row here. What goes wrong elsewhere is added to it, as if it had been here.
    threads : int, optional
        Rows at most that run at a time; as many as there are cores unless given.
    address : str, optional
        Of the machines, for an engine that takes one.
    stop_requested : callable
        From True on no other row is begun, and those in flight are finished.
    """

    numbers: Iterator[int]
    rows: int
    grid: Grid
    work: Work
    threads: int | None
    address: str | None
    stop_requested: Callable[[], bool]


class Engine(NamedTuple):
    """One way of running rows.

    Attributes
    ----------
    carried_out : callable
        Rows of an order with their results, in any order; None for one that has shown a fault.
    takes_address : bool
        Whether it can be told where its machines are.
    """

    carried_out: Callable[[Order], Generator[tuple[Row, Result | None]]]
    takes_address: bool = False
