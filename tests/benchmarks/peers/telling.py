"""What was found, row by row: printed as it is found, or all of it as one JSON."""

import json

import numpy as np


class Told:
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

    def time(self, name: str, seconds: float, ours_s: float, compile_s: float | None = None) -> None:
        row = {"name": name, "s": seconds, "over_ours": seconds / ours_s, "compile_s": compile_s}
        self._found["times"].append(row)
        compiled = "" if compile_s is None else f" (and compiled in {compile_s:.1f} s)"
        self._print(f"{1e3 * seconds:8.3f} ms  {seconds / ours_s:6.2f}  {name}{compiled}")

    def ratio(self, name: str, value: float, at_most: float) -> None:
        row = {"name": name, "value": value, "at_most": at_most, "ok": value <= at_most}
        self._found["ratios"].append(row)
        self._print(f"{value:8.2f}     <= {at_most:<4g}  {name}{'' if row['ok'] else '  MISSED'}")

    def _print(self, line: str) -> None:
        if not self._as_json:
            print(line, flush=True)
