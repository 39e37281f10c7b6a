"""A study, and a sweep of it on a Ray cluster."""

from spheretwin.study import runner

STUDY = """
name = "small"
scenario = "sinusoid"
samples = 120
telemetry = [7]
[fields]
duration = 0.1
hardware = "electronics"
[[axis]]
field = "plant.modelling_error"
kind = "uniform"
low = -0.2
high = 0.5
[[axis]]
field = "disturbance.load"
kind = "values"
values = [0.0, 1.0]
"""

ROWS = 240


def run(study, folder, machines, **options):
    return runner.run(study, folder, engine="ray", address=machines.address, **options)


def same_table(folder, wanted):
    return (folder / "table.parquet").read_bytes() == (wanted / "table.parquet").read_bytes()
