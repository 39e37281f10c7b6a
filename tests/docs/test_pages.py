"""Every snippet of README, of the documentation and of docstrings runs as it is written."""

import re
from unittest import SkipTest

import pytest

from tests.docs.snippets import LANGUAGES, MODULES, PAGES, ROOT, examples, run_shell

FIRST_SUITE = (
    "README.md", "docs/how-to/own_scenario.md", "docs/how-to/replay.md", "docs/how-to/inject_fault.md",
    "docs/how-to/change_during_run.md",
)  # fmt: skip
"""Pages with commands in the first suite: the main job, scenarios, replay, faults and changes of a run."""

LONG = (
    "twin/machine/__init__.py", "docs/tutorials/policy.md", "docs/reference/plant_step.md",
    "docs/how-to/mujoco_plugin.md",
)  # fmt: skip
"""Pages and docstrings without commands that compile for 2 to 5 s."""

RELEASE = pytest.mark.release("snippets of a page, 0.5 to 35 s; the tests of each part have what it does")


def _is_long(page):
    name = str(page.relative_to(ROOT))
    has_commands = any(
        example.document.text[example.start :].startswith("```sh") for example in examples(page)
    )
    return name in LONG or (has_commands and name not in FIRST_SUITE)


PAGES_WITH_SNIPPETS = [
    pytest.param(page, marks=RELEASE if _is_long(page) else ())
    for page in (*PAGES, *MODULES)
    if examples(page)
]


def reason_to_skip(example):
    """Run a snippet; the reason if it is skipped, else None."""
    try:
        example.evaluate()
    except SkipTest as skipped:
        return str(skipped)


@pytest.mark.parametrize("page", PAGES_WITH_SNIPPETS, ids=lambda page: str(page.relative_to(ROOT)))
def test_snippets_run_as_written(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for example in examples(page):
        reason = reason_to_skip(example)
        assert reason != "", f"{page}:{example.line}: a skipped snippet states its reason"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_runner_knows_the_language_of_each_block(page):
    fences = re.findall(r"^ *```(.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    opening = {fence.strip() for fence in fences[::2] if not fence.startswith("{")}
    assert opening <= LANGUAGES, "a block in another language would not run"


def test_the_tutorials_are_typed_in_a_folder_that_git_ignores():
    """Snippets write recordings, figures and laws: in the root of a clone they would be untracked files."""
    enter = "mkdir -p work && cd work"
    assert "/work/" in (ROOT / ".gitignore").read_text(encoding="utf-8").splitlines()
    for page in ("README.md", "docs/tutorials/index.md", "docs/tutorials/first_run.md"):
        assert enter in (ROOT / page).read_text(encoding="utf-8"), page
    first = (ROOT / "docs" / "tutorials" / "first_run.md").read_text(encoding="utf-8")
    assert first.index(enter) < first.index("spheretwin simulate")


def test_an_example_of_a_docstring_that_prints_something_else_is_noticed(tmp_path):
    module = tmp_path / "module.py"
    module.write_text('"""Module.\n\n>>> 1 + 1\n3\n"""\n')
    (example,) = examples(module)
    with pytest.raises(AssertionError, match="Expected:\n    3\nGot:\n    2"):
        example.evaluate()


def test_a_command_that_fails_in_the_middle_of_a_block_is_noticed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = tmp_path / "page.md"
    page.write_text("```sh\nspheretwin simulate no_such_scenario\necho done\n```\n")
    (example,) = examples(page)
    with pytest.raises(AssertionError, match="exit code 2"):
        run_shell(example)


def test_a_block_with_a_file_name_is_written_and_the_next_one_can_import_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    page = tmp_path / "page.md"
    page.write_text(
        "```python\n# written_by_a_page.py\nANSWER = 42\n```\n\n"
        "```python\nimport written_by_a_page\nassert written_by_a_page.ANSWER == 42\n```\n"
    )
    for example in examples(page):
        example.evaluate()
