"""Sweeps: a study of many runs, row by row, over all cores, interrupted and resumed, as one table."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from spheretwin.study.runner import Found, run_study
from spheretwin.study.study import Study, load


def run(
    study: Study | str,
    out: Path | str | None = None,
    *,
    engine: str = "local",
    address: str | None = None,
    threads: int | None = None,
    limit: int | None = None,
    done: Callable[[int, int], None] = lambda rows, of: None,
    stop_requested: Callable[[], bool] = lambda: False,
) -> Found:
    """Run a study.

    Parameters
    ----------
    study : Study or str
        Or its shipped name, or the path of its TOML file.
    out : path, optional
        Folder for journal and table; that of the study's name in the working folder unless given. Where a
        journal of the same study is there already, its rows are not run again.
    engine : str
        ``local``, threads of this process, or ``ray``; the table does not depend on it.
    address : str, optional
        For ``ray``: ``auto``, ``HOST`` or ``HOST:PORT`` of a cluster that this machine is a node of, on every
        node of which are the same sources, versions and files. One that lasts as long as the study is started
        on this machine unless given.
    threads : int, optional
        Rows at a time; as many as there are cores unless given, and the table does not depend on it.
    limit : int, optional
        Run only the first rows, as many as this. The table keeps rows behind them that were finished
        earlier.
    done : callable
        Told of the rows that are finished, and of how many there are, as they are finished.
    stop_requested : callable
        True ends the study when the rows in flight are finished.

    Raises
    ------
    InputError
        The study, the scenario or the folder cannot be used.
    SpheretwinError
        A row differs between the plants, a file could not be written, or a cluster was lost; what is finished
        is kept.
    """
    chosen = load(study) if isinstance(study, str) else study
    folder = Path(out) if out is not None else Path(f"{chosen.name}_study")
    return run_study(
        chosen,
        folder,
        engine=engine,
        address=address,
        threads=threads,
        limit=limit,
        done=done,
        stop_requested=stop_requested,
    )
