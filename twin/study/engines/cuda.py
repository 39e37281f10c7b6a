"""GPU: the rows of a block in one call of a kernel, a thread each.

Threads of this process set blocks up in turns: while one block is on the GPU, the next one is set up. Rows
that no block takes, with events or stored telemetry, run on the processor, as those of the plant MuJoCo.
"""

from __future__ import annotations

from functools import partial

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.user_code import is_reference
from spheretwin.study.engines import threads
from spheretwin.study.engines.engine import Engine
from spheretwin.study.row import Rows
from spheretwin.study.study import FAST

FIRST_ROWS, MOST_ROWS = 1024, 8192
"""Rows of the first block, and of the largest one: its records, inputs and set-up need 100 kB a row."""

THREADS = 2
"""One waits for the GPU while the other one sets up its block."""


def prepare(rows: Rows) -> Rows:
    """Return the rows of a study for the GPU.

    Raises
    ------
    InputError
        There is no GPU, or it runs none of the rows.
    """
    from spheretwin.loop.cuda_block import CudaBlock, check_gpu_runs  # imports the compiler for GPUs

    if own := next(filter(is_reference, rows.study.metrics), None):
        raise InputError(f"cuda: expected figures of this package, received {own}; engine processes runs it")
    engine = FAST if rows.chooses_plant else rows.base.plant.engine
    base = rows.base
    check_gpu_runs(engine, check_bounds=base.controller.check_bounds, hall=base.sensors.hall.on)
    return rows.with_block(CudaBlock)


ENGINE = Engine(
    partial(threads.run, first=FIRST_ROWS, most=MOST_ROWS), prepare=prepare, in_process=True, threads=THREADS
)
