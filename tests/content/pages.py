"""Pages as text: Markdown as it is, HTML as a tree of elements with a line for each row of a table."""

import base64
import json
import re
import struct
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import numpy as np

from tests.content.figures import captured
from tests.content.values import array, tree

VOID = {"meta", "link", "br", "hr", "img", "input", "line", "path", "rect", "circle", "use"}


class _Tree(HTMLParser):
    """Lines of a page: an element or a text each; cells of a row of a table in one line."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.lines: list[str] = []
        self.scripts: list[str] = []
        self._depth = 0
        self._silent = ""
        self._cells: list[str] | None = None

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag == "tr":
            self._cells = []
        elif tag in ("td", "th") and self._cells is not None:
            look = dict(attributes).get("style") or dict(attributes).get("class") or ""
            self._cells.append(f"{tag}{f' {look}' if look else ''}:")
        elif self._cells is None:
            texts = [f"{name}={_short(value)!r}" for name, value in attributes]
            self.lines.append("  " * self._depth + " ".join([tag, *texts]))
            self._depth += tag not in VOID
        if tag in ("script", "style"):
            self._silent = tag
            self.scripts += [""] if tag == "script" else []

    def handle_endtag(self, tag: str) -> None:
        if tag == "tr":
            self.lines.append("  " * self._depth + f"row {' | '.join(self._cells or [])}")
            self._cells = None
        elif tag not in (*VOID, "td", "th") and self._cells is None:
            self._depth -= 1
        if tag == self._silent:
            self._silent = ""

    def handle_data(self, data: str) -> None:
        text = " ".join(data.split())
        if self._silent:
            self.scripts[-1:] = [self.scripts[-1] + data] if self._silent == "script" else self.scripts[-1:]
        elif text and self._cells is not None:
            self._cells[-1:] = [f"{self._cells[-1] if self._cells else ''} {text}"]
        elif text:
            self.lines.append("  " * self._depth + repr(text))


def html_text(page: str) -> str:
    """Return the elements and texts of a page; of scripts the figures that they draw."""
    parser = _Tree()
    parser.feed(page)
    figures = []
    for script in parser.scripts:
        if match := re.match(r"\s*const figures = (\{.*?\});\n", script, re.DOTALL):
            for name, figure in json.loads(match.group(1)).items():
                figures += [f"plot {name}", *(f"  {line}" for line in plotly_lines(figure))]
    return "\n".join([*parser.lines, *figures])


def plotly_lines(figure: dict) -> list[str]:
    """Return the lines of a plotly figure: each trace with its data, then the layout."""
    lines = []
    for trace in figure["data"]:
        parts = [f"{name} {_plotly(value)}" for name, value in trace.items()]
        lines.append(f"trace {', '.join(parts)}")
    layout = {name: value for name, value in figure["layout"].items() if name != "template"}
    annotations = layout.pop("annotations", [])
    lines += [
        f"note {', '.join(f'{name} {_plotly(value)}' for name, value in note.items())}"
        for note in annotations
    ]
    return [*lines, "layout", *(f"  {line}" for line in tree(layout))]


def _plotly(value: object) -> str:
    if isinstance(value, dict) and set(value) >= {"dtype", "bdata"}:
        values = np.frombuffer(base64.b64decode(value["bdata"]), value["dtype"])
        shape = [int(size) for size in str(value.get("shape", len(values))).split(",")]
        return array(values.reshape(shape))
    if isinstance(value, list) and value and all(isinstance(each, int | float) for each in value):
        return array(np.array(value, dtype=float))
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name} {_plotly(inside)}" for name, inside in value.items()) + "}"
    return repr(value)


def _short(value: str | None) -> str | None:
    """Return an attribute; of an image in the page its kind and size."""
    if value and value.startswith("data:image/png;base64,"):
        width, height = struct.unpack(">II", base64.b64decode(value.partition(",")[2][:64])[16:24])
        return f"PNG of {width} × {height}"
    return value


def folder_text(write: Callable[[Path], object], folder: Path, html: bool = False) -> str:
    """Return what a call writes into a folder: pages, texts, JSON, and the figures as they are saved."""
    with captured() as figures:
        write(folder)
    out = []
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        if path.name in figures:
            out += [f"=== {name}", figures.pop(path.name)]
        elif path.suffix == ".html":
            out += [f"=== {name}", html_text(path.read_text(encoding="utf-8"))] if html else [f"=== {name}"]
        elif path.suffix == ".json":
            out += [f"=== {name}", *tree(json.loads(path.read_text(encoding="utf-8")))]
        elif path.suffix in (".md", ".txt", ".csv"):
            out += [f"=== {name}", path.read_text(encoding="utf-8")]
        elif path.is_file():
            out.append(f"=== {name}")
    assert not figures  # every figure that was saved is in the folder
    return "\n".join(out)
