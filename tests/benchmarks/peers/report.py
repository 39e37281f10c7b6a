"""What was found, row by row: printed as it is found, or all of it as one JSON."""

import json
from typing import NamedTuple

import numpy as np


class Taken(NamedTuple):
    """How long something takes."""

    wall_s: float
    cores_s: float
    """Of all cores together: on a machine that is shared, the steadier of the two."""

    def of(self, parts: float) -> "Taken":
        """How long each of its parts takes."""
        return Taken(self.wall_s / parts, self.cores_s / parts)


class Report:
    def __init__(self, as_json: bool) -> None:
        self._as_json = as_json
        self._found: dict[str, list[dict[str, object]]] = {
            "not_installed": [],
            "agreement": [],
            "times": [],
            "ratios": [],
        }

    def finished(self) -> bool:
        """Whether no bound was missed."""
        if self._as_json:
            print(json.dumps(self._found))
        return all(row.get("ok", True) for rows in self._found.values() for row in rows)

    def head(self, text: str) -> None:
        self._print(f"\n{text}")

    def not_installed(self, name: str, error: ImportError) -> None:
        self._found["not_installed"].append({"name": name, "error": str(error)})
        self._print(f"NOT INSTALLED, left out: {name} ({error})")

    def agreement(self, name: str, difference: float, bound: float, unit: str) -> None:
        ok = bool(difference <= bound)  # not where it is no number
        value = difference if np.isfinite(difference) else None
        row = {"name": name, "value": value, "at_most": bound, "unit": unit, "ok": ok}
        self._found["agreement"].append(row)
        self._print(f"{difference:8.1e}  <= {bound:<6g}  {name}, {unit}{'' if ok else '  MISSED'}")

    def time(self, name: str, taken: Taken, ours: Taken, compile_s: float | None = None) -> None:
        over_ours = taken.wall_s / ours.wall_s
        row = {"name": name, **taken._asdict(), "over_ours": over_ours, "compile_s": compile_s}
        self._found["times"].append(row)
        compiled = "" if compile_s is None else f" (and compiled in {compile_s:.1f} s)"
        times = f"{1e3 * taken.wall_s:8.3f} ms {1e3 * taken.cores_s:8.3f} ms"
        self._print(f"{times}  {over_ours:6.2f}  {name}{compiled}")

    def ratio(self, name: str, value: float, at_most: float | None = None) -> None:
        ok = at_most is None or value <= at_most
        self._found["ratios"].append({"name": name, "value": value, "at_most": at_most, "ok": ok})
        bound = "reported" if at_most is None else f"<= {at_most}"
        self._print(f"{value:8.2f}  {bound:>8}  {name}{'' if ok else '  MISSED'}")

    def _print(self, line: str) -> None:
        if not self._as_json:
            print(line, flush=True)
