"""Studies: many runs over all cores, interruptible and resumable, with one table as the result."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from spheretwin.study.runner import StudyResult, run_study
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
) -> StudyResult:
    """Run a study.

    Parameters
    ----------
    study : Study or str
        Study, its shipped name, or the path of its TOML file.
    out : path, optional
        Folder of journal and table; ``NAME_study`` in the working folder unless given. Rows in a journal of
        the same study are not run again.
    engine : str
        ``local``, threads of this process, or ``ray``; the table does not depend on it.
    address : str, optional
        For ``ray``: ``auto``, ``HOST`` or ``HOST:PORT`` of a cluster that this machine is a node of; every
        node needs the same sources, versions and files. Without it a cluster on this machine is started for
        the study.
    threads : int, optional
        Rows at a time; number of cores unless given. The table does not depend on it.
    limit : int, optional
        Run only this number of first rows. The table includes later rows that were finished earlier.
    done : callable
        Receives the number of finished rows, and of all rows, after each row.
    stop_requested : callable
        After True the running rows are finished, and no other is started.

    Raises
    ------
    InputError
        The study, the scenario or the folder cannot be used.
    SpheretwinError
        A row differs between the plants, a file could not be written, or a cluster was lost; finished rows
        are stored.
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
