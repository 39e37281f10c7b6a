"""Results of the comparison: printed row by row, or all of them as one JSON."""

import json
from typing import NamedTuple

import numpy as np


class Times(NamedTuple):
    """Time of some work."""

    wall_s: float
    cores_s: float
    """Of all cores together: the steadier of the two on a shared machine."""

    def of(self, parts: float) -> "Times":
        """Return the time of each of its parts."""
        return Times(self.wall_s / parts, self.cores_s / parts)


class Report:
    def __init__(self, as_json: bool) -> None:
        self._as_json = as_json
        self._rows: dict[str, list[dict[str, object]]] = {
            "not_installed": [], "agreement": [], "times": [], "ratios": [],
        }  # fmt: skip

    def finished(self) -> bool:
        """Print the JSON if it is asked for; return True if no bound was missed."""
        if self._as_json:
            print(json.dumps(self._rows))
        return all(row.get("ok", True) for rows in self._rows.values() for row in rows)

    def head(self, text: str) -> None:
        self._print(f"\n{text}")

    def not_installed(self, name: str, error: ImportError) -> None:
        self._rows["not_installed"].append({"name": name, "error": str(error)})
        self._print(f"NOT INSTALLED, left out: {name} ({error})")

    def agreement(self, name: str, difference: float, bound: float, unit: str) -> None:
        ok = bool(difference <= bound)  # False for NaN
        value = difference if np.isfinite(difference) else None
        row = {"name": name, "value": value, "at_most": bound, "unit": unit, "ok": ok}
        self._rows["agreement"].append(row)
        self._print(f"{difference:8.1e}  <= {bound:<6g}  {name}, {unit}{'' if ok else '  MISSED'}")

    def time(self, name: str, times: Times, ours: Times, compile_s: float | None = None) -> None:
        over_ours = times.wall_s / ours.wall_s
        row = {"name": name, **times._asdict(), "over_ours": over_ours, "compile_s": compile_s}
        self._rows["times"].append(row)
        compiled = "" if compile_s is None else f" (and compiled in {compile_s:.1f} s)"
        text = f"{1e3 * times.wall_s:8.3f} ms {1e3 * times.cores_s:8.3f} ms"
        self._print(f"{text}  {over_ours:6.2f}  {name}{compiled}")

    def ratio(self, name: str, value: float, at_most: float | None = None) -> None:
        ok = at_most is None or value <= at_most
        self._rows["ratios"].append({"name": name, "value": value, "at_most": at_most, "ok": ok})
        bound = "reported" if at_most is None else f"<= {at_most}"
        self._print(f"{value:8.2f}  {bound:>8}  {name}{'' if ok else '  MISSED'}")

    def _print(self, line: str) -> None:
        if not self._as_json:
            print(line, flush=True)
