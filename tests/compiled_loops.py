"""Compile the loop and the stages of the first suite, which otherwise each process of the tests compiles."""

from multiprocessing import get_context

from spheretwin import load, simulate

# A stage has ideal sensors or a chain of them, and a lag of the currents or a chain as its drive.
HARDWARE = (
    {"hardware": "electronics"},
    {"sensors.encoder.counts": 4096},
    {"drive.supply_V": 24.0},
    {"hardware": "prototype"},
)


def compile_stages(engine):
    """Compile the stages of an engine."""
    for hardware in ({}, *HARDWARE):
        simulate(load("hold", {"duration": 0.1, "plant.engine": engine, **hardware}))


if __name__ == "__main__":
    simulate(load("hold", {"duration": 0.1}))  # the loop, for both engines
    with get_context("fork").Pool(2) as pool:
        pool.map(compile_stages, ("mujoco", "lagrangian"), 1)
