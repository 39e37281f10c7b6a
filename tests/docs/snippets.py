"""Runner of the snippets of a page, as a reader would type them: one page, one empty folder, in order.

The examples of the docstrings of a module run in the same way, as doctests.

- `python` runs in one namespace; `sh` runs in bash, which stops at the first command that fails.
- A block that begins with its file name (``# mine.py``, ``/* pid.c */``) becomes that file.
- Other blocks of `toml` and `json` must be valid; `text` and other languages are not run.
- ``<!-- skip: next "reason" -->`` skips a block; ``if(SHORT, reason="…")`` skips one that takes minutes,
  unless the environment variable `SPHERETWIN_LONG_SNIPPETS` is set, as `make docs-snippets` does.
"""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

from sybil import Document, Example
from sybil.document import PythonDocStringDocument
from sybil.evaluators.python import PythonEvaluator
from sybil.parsers.markdown import CodeBlockParser, SkipParser
from sybil.parsers.rest import DocTestParser

ROOT = Path(__file__).parents[2]
SHORT = not os.environ.get("SPHERETWIN_LONG_SNIPPETS")

FILE_NAME = re.compile(r"(?:#|//|/\*) (?P<name>[\w./-]+\.(?:py|toml|c|csv|m|h))(?: \*/)?\s*$")

LANGUAGES = {"python", "sh", "toml", "json", "c", "text", "matlab", "sql", "xml"}
"""Languages of blocks. The last four are not run: output, and languages without an interpreter here."""

MODULES = sorted(
    path
    for folder in ("models", "control", "viz", "twin")
    for path in (ROOT / folder).rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)

PAGES = sorted(
    path
    for pattern in ("*.md", "docs/**/*.md", "models/*.md", "twin/**/*.md", "viz/**/*.md")
    for path in ROOT.glob(pattern)
    if "generated" not in path.parts
)


def named_file(code: str) -> str | None:
    """The name of the file that a block shows, if its first line is that name."""
    match = FILE_NAME.match(code.splitlines()[0]) if code.strip() else None
    return match["name"] if match else None


def saved(code: str) -> bool:
    """Write a block that shows a file; True if it is one."""
    if not (name := named_file(code)):
        return False
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    Path(name).write_text(code, encoding="utf-8")
    return True


def run_shell(example: Example) -> None:
    """Run a block in bash with the environment of these tests on the path."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", str(example.parsed)],
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, (
        f"line {example.line}: exit code {done.returncode}\n{done.stdout}{done.stderr}"
    )


def parse_or_save(parse):
    """An evaluator of blocks that are files or fragments of data."""

    def evaluate(example: Example) -> None:
        if not saved(str(example.parsed)):
            parse(str(example.parsed))

    return evaluate


def run_or_save(example: Example) -> None:
    """Run a block of Python, or write the file that it shows."""
    if not saved(str(example.parsed)):
        PythonEvaluator()(example)


PARSERS = [
    SkipParser(), CodeBlockParser("python", run_or_save), CodeBlockParser("sh", run_shell),
    CodeBlockParser("toml", parse_or_save(tomllib.loads)), CodeBlockParser("json", parse_or_save(json.loads)),
    CodeBlockParser("c", parse_or_save(lambda code: None)),
]  # fmt: skip


def examples(page: Path) -> list[Example]:
    """The snippets of a page, or the examples in the docstrings of a module, in order."""
    if page.suffix == ".py":
        document = PythonDocStringDocument.parse(str(page), DocTestParser())
        document.pop_evaluator(document.import_document)  # an example imports what it uses
    else:
        document = Document.parse(str(page), *PARSERS)
    document.namespace["SHORT"] = SHORT
    return list(document.examples())
