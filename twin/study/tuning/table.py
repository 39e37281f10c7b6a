"""The table of a tuning: one Parquet file, a row a trial, its gains and its objectives."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from spheretwin.models.telemetry import checksums
from spheretwin.twin.study.row import Rows
from spheretwin.twin.study.study import Study
from spheretwin.twin.study.tuning import gains
from spheretwin.twin.study.tuning.section import Gain, Objective
from spheretwin.twin.study.tuning.trial import Ended, Kept

NAME = "trials.parquet"

OfLaw = tuple[str, Sequence[Gain], Sequence[Kept], Sequence[int]]
"""Name of a law, its gains, its trials, numbers of the best."""


def write(path: Path, study: Study, rows: Rows, laws: Sequence[OfLaw]) -> None:
    """Write all finished trials, law by law, whole or not at all.

    An objective stands under its name, its values of each row under the same name with ``, each row``. A
    pruned trial has what its objectives are at least, or at most where they are to be large.

    Raises
    ------
    SpheretwinError
        It could not be written; what was there before is untouched.
    """
    import pyarrow as pa  # slow to import

    optimise = gains.section_of(study)
    objectives = optimise.objective
    names = dict.fromkeys(each for _, of_law, _, _ in laws for each in gains.numbers(of_law))
    settings = dict.fromkeys(
        each.field for _, of_law, _, _ in laws for gain in of_law for each in gain.settings
    )
    kinds = {
        "law": pa.string(),
        "trial": pa.int64(),
        "ended": pa.string(),
        "reason": pa.string(),
        "best": pa.bool_(),
        "rows": pa.int64(),
        **dict.fromkeys([*names, *settings], pa.float64()),
        **{each.called: pa.float64() for each in objectives},
        **{f"{each.called}, each row": pa.list_(pa.float64()) for each in objectives},
    }
    records = [
        {
            **_head(law, each, best),
            **each.chosen,
            **gains.values(of_law, each.chosen),
            **_told(objectives, each),
        }
        for law, of_law, kept, best in laws
        for each in kept
    ]
    metadata = {
        "study": study.model_dump_json(),
        "optimise": optimise.model_dump_json(),
        "scenario": rows.base.model_dump_json(),
    }
    columns = [pa.array([each.get(name) for each in records], type=kind) for name, kind in kinds.items()]
    schema = pa.schema([pa.field(name, kind) for name, kind in kinds.items()], metadata=metadata)
    checksums.write_parquet(path, schema, [pa.table(columns, schema=schema)], compression="zstd")


def _head(law: str, kept: Kept, best: Sequence[int]) -> dict[str, Any]:
    return {
        "law": law,
        "trial": kept.number,
        "ended": str(kept.tried.ended),
        "reason": kept.tried.reason or None,
        "best": kept.number in best,
        "rows": len(kept.tried.each),
    }


def _told(objectives: Sequence[Objective], kept: Kept) -> dict[str, Any]:
    told: dict[str, Any] = {}
    for place, objective in enumerate(objectives):
        lost = kept.tried.ended == Ended.LOST
        told[objective.called] = None if lost else objective.sign * kept.tried.values[place]
        told[f"{objective.called}, each row"] = [objective.sign * each[place] for each in kept.tried.each]
    return told
