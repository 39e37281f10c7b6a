"""Messages of commands about laws and metrics of users that fail, and about files that are no run."""

import re
import shutil

import pyarrow.parquet as parquet

from spheretwin.models.telemetry.checksums import METADATA
from tests.content.content import command, content_test, scratch
from tests.control.test_failing_user_law import FILE
from tests.twin.analysis.runs import PLANT, written

RAISING = ["leaves", "closes", "strange", "returns", "rebinds", "late", "raises", "asserts"]
NOT_COMPILED = ["unnamed", "nested", "adds", "absent", "opens", "short"]
OUTSIDE = ["outside", "outside_below"]


def failing_laws():
    """Laws that raise, that do not compile, and that write outside their arrays; metrics that raise."""
    folder = scratch("failing_laws")
    (file := folder / "failing.py").write_text(FILE)

    def run(law, *more):
        return command(
            *["simulate", "hold", "--duration", "0.05", "--controller.law"], f"{file}:{law}", *more
        )

    def sweep(fields):
        (study := folder / "study.toml").write_text(f'name = "failing"\nscenario = "hold"\n{fields}\n')
        shutil.rmtree(folder / "out", ignore_errors=True)
        printed = command("sweep", study, "--out", folder / "out", "--json")
        return re.sub("with key [0-9a-f]{16}", "with key KEY", printed.partition("\nstderr:")[2])

    texts = [run(law, *more) for law in RAISING for more in ((), ("--json",))]
    texts += [run(law) for law in NOT_COMPILED]
    texts += [run(law, "--controller.check-bounds", "true") for law in OUTSIDE]
    # The currents run down first, and the line must not have the time of their end.
    texts += [run("raises", "--hardware", "electronics", "--watchdog.rundown-s", "0.01")]
    axis = '[[axis]]\nfield = "disturbance.load"\nkind = "values"\nvalues = [0.0, 1.0]'
    laws = [f'law = "{file}:{law}"' for law in ("leaves", "strange", "raises")]
    laws += [f'law = "{file}:{law}", check_bounds = true' for law in OUTSIDE]
    texts += [sweep(f"fields = {{duration = 0.05}}\nlaw = [{{{law}}}]\n{axis}") for law in laws]
    texts += [sweep(f'fields = {{duration = 0.01}}\nmetrics = ["rms_error_rad", "{file}:metric_leaves"]')]
    for metric in ("metric_leaves", "closes", "strange"):
        printed = command("simulate", "hold", "--duration", "0.05", "--metric", f"{file}:{metric}")
        texts += [line for line in printed.splitlines() if metric in line or "exit" in line]
    return "\n".join(texts)


FOREIGN = {
    "empty.parquet": b"", "empty.rrd": b"", "text.parquet": b"no run", "missing.parquet": None,
    "text.rrd": b"no run, and longer than a header", "folder.rrd": None, "folder.parquet": None,
    "header.rrd": b"RRF2\x00)\x00\x00\x01\x02\x00\x00",
}  # fmt: skip
ODD = [
    {"scenario": b"\xff" * 3000}, {"journal": None}, {"journal": b"x" * 3000},
    {"scenario": b'{"controller": 3}'},
]  # fmt: skip


def foreign_files():
    """Review, replay and recovery of what is no run, and of files without checksums with odd metadata."""
    folder = scratch("foreign")
    telemetry, recording = written(scratch("foreign_run"), duration=0.2, **PLANT)
    out, paths = folder / "out", []
    for name, content in FOREIGN.items():
        paths.append(folder / name)
        if content is not None:
            paths[-1].write_bytes(content)
        elif name.startswith("folder"):
            paths[-1].mkdir(exist_ok=True)
    for whole in (telemetry, recording):
        paths.append(folder / f"cut{whole.suffix}")
        paths[-1].write_bytes(whole.read_bytes()[:5000])
    arrow = parquet.ParquetFile(telemetry).read()
    usual = {name: text for name, text in arrow.schema.metadata.items() if name.decode() not in METADATA}
    for place, odd in enumerate(ODD):
        metadata = usual | {name.encode(): text for name, text in odd.items()}
        metadata = {name: text for name, text in metadata.items() if text is not None}
        paths.append(folder / f"odd{place}.parquet")
        parquet.write_table(arrow.replace_schema_metadata(metadata), paths[-1])
    texts = [command("review", path) for path in paths]
    texts += [command("recover", path, "--out", out) for path in paths]
    texts += [command("simulate", "--replay", path) for path in paths if path.stem.startswith("odd")]
    return "\n".join([*texts, str(sorted(path.name for path in folder.iterdir()))])


CASES = {"failing_laws": failing_laws, "foreign_files": foreign_files}


test_content = content_test(CASES)
