"""``spheretwin completion``: scripts for bash, zsh and fish, and the words that they offer."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from importlib import import_module

from spheretwin import cli
from spheretwin.cli.options import Parser, verb

SCRIPTS = {
    "bash": """_spheretwin() {
    local IFS=$'\\n'
    COMPREPLY=($(spheretwin completion words "${COMP_WORDS[@]:1:COMP_CWORD}" 2> /dev/null))
    [ "${#COMPREPLY[@]}" -gt 0 ] || compopt -o default
}
complete -o nosort -F _spheretwin spheretwin
""",
    "zsh": """#compdef spheretwin
_spheretwin() {
    local -a offered
    offered=("${(@f)$(spheretwin completion words "${(@)words[2,$CURRENT]}" 2> /dev/null)}")
    if [ -n "${offered[1]}" ]; then compadd -a offered; else _files; fi
}
compdef _spheretwin spheretwin
""",
    "fish": """complete -c spheretwin -a \
"(spheretwin completion words (commandline -opc)[2..] (commandline -ct) 2> /dev/null)"
""",
}
"""Script of each shell; the last word that it passes is the one that is being typed."""


@verb(
    f"SHELL  {', '.join(SCRIPTS)}",
    unlisted="WORD",
    shell=(*SCRIPTS, "words"),
    word={"nargs": argparse.REMAINDER},
)
def run(options: argparse.Namespace) -> bool:
    """Print the completion of a shell: verbs, options, scenarios, fields.

    To install it:
      bash: spheretwin completion bash >> ~/.bashrc
      zsh:  spheretwin completion zsh >> ~/.zshrc, after compinit
      fish: spheretwin completion fish > ~/.config/fish/completions/spheretwin.fish
    """
    if options.shell == "words":
        print("\n".join(words(options.word)))
    else:
        print(SCRIPTS[options.shell], end="")
    return True


def words(typed: Sequence[str]) -> list[str]:
    """Return the words that can replace the last one; none where a file is expected."""
    *before, last = typed or [""]
    return [word for word in _offered(before, last) if word.startswith(last)]


def _offered(before: Sequence[str], last: str) -> Iterator[str]:
    if not before:
        yield from (*cli.VERBS, "--help", "--version")
        return
    if before[0] not in cli.VERBS:
        return
    parsers = cli.parsers_of(before[0])
    parser = parsers.get(" ".join(before[:2]), parsers[before[0]])
    has_fields = bool(parser.get_default("has_fields"))
    option = next((action for action in parser._actions if before[-1] in action.option_strings), None)
    if option and option.nargs != 0:
        yield from map(str, option.choices or ())
    elif has_fields and before[-1].startswith("--"):
        yield from _values(before[-1])
    elif last.startswith("-"):
        yield from (name for action in parser._actions for name in action.option_strings)
        if has_fields:
            yield from _flags()
    else:
        yield from _positional(parser)


def _positional(parser: Parser) -> Iterator[str]:
    for action in parser._actions:
        if not action.option_strings:
            yield from map(str, action.choices or ())
            if action.metavar in ("SCENARIO", "STUDY"):
                reading = import_module("spheretwin.scenario.reading")
                folder = "scenario" if action.metavar == "SCENARIO" else "study"
                yield from reading.toml_names(reading.FOLDER.parent.parent / folder / "shipped")


def _flags() -> Iterator[str]:
    """Yield the flags of all fields of a scenario outside lists."""
    fields = import_module("spheretwin.scenario.fields")
    sections = import_module("spheretwin.scenario.sections")
    names = (name for name, _ in fields.every_field(sections.Scenario) if fields.INDEX not in name)
    yield from dict.fromkeys("--" + name.replace("_", "-") for name in names)


def _values(flag: str) -> Iterator[str]:
    """Yield the members of a family after the flag that selects one, such as the laws."""
    fields = import_module("spheretwin.scenario.fields")
    sections = import_module("spheretwin.scenario.sections")
    yield from fields.families(sections.Scenario).get(flag[2:].replace("-", "_"), ())
