"""Command line `spheretwin`: one file for each verb."""

from __future__ import annotations

import argparse
import errno
import gc
import io
import os
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from importlib import import_module
from importlib.metadata import version
from itertools import pairwise

from spheretwin.cli.options import Parser, Verb
from spheretwin.models.base.errors import (
    InputError,
    SpheretwinError,
    is_plain,
    nearest,
    one_line,
    shown,
    without_breaks,
)

DONE, FAILED, BAD_INPUT = 0, 1, 2

VERBS = {
    "simulate": "run a scenario",
    "machine": "simulate the machine for a controller in another program",
    "drive": "drive a machine with the controller of a scenario",
    "bench": "drive the running twin from a browser",
    "crosscheck": "compare the engine with the Lagrangian and Pinocchio",
    "reproduce": "run the experiments of the paper and compare the results with the paper",
    "sweep": "run a study: many runs, one table",
    "review": "review runs from their telemetry or recordings",
    "recover": "recover a complete file from a killed run",
    "shadow": "estimate the state of a machine from its log",
    "identify": "identify parameters of a machine from its logs",
    "validate": "judge a twin by a log",
    "watch": "raise alarms when a machine changes",
    "magnetics": "analyse the magnetic model",
    "export": "write plant and controller as an FMU or as C files",
    "log": "check the log of a machine",
    "link": "measure round trip, jitter and loss of a link to a machine",
    "explain": "print value, unit, distribution and origin of fields",
    "new": "write a template: a law, an actuator or a study",
    "doctor": "print what is installed, and what is missing for which purpose",
    "completion": "print the completion of a shell",
}
"""Verbs: modules of this folder, and their help. A module is imported only if its verb is called."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb; return the exit code."""
    # Errors of Rerun are raised or found at the end of its files: its own log would only repeat them.
    os.environ.setdefault("RUST_LOG", "off")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal without Greek letters
    try:
        given = _plain(sys.argv[1:] if arguments is None else arguments)
        with _without_garbage_collection() if arguments is None else nullcontext():
            parser = _parser(given)
        options, rest = parser.parse_known_args(given)
        options.fields = rest
        if _is_help(options):
            import_module("spheretwin.cli.help").print_help(options)
            succeeded = True
        else:
            _check_flags(given, options)
            options.parser.check(options)
            with import_module("spheretwin.viz.terminal.compilation").announced():
                succeeded = options.run(options)
        sys.stdout.flush()
    except InputError as error:
        return _refused(f"{error}", BAD_INPUT)
    except SpheretwinError as error:
        return _refused(f"{error}", FAILED)
    except KeyboardInterrupt:
        return _refused("interrupted", FAILED)
    except MemoryError:
        return _refused("expected enough memory for the command, received too little", FAILED)
    except BrokenPipeError:  # the reader of our output has gone, as `head` does
        _discard_stdout()
        return FAILED
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:  # no file can have the name that was given
            return _refused(f"command line: expected a shorter path, {without_breaks(error)}", BAD_INPUT)
        _discard_stdout()
        return _refused(f"output: {without_breaks(error)}", FAILED)
    return DONE if succeeded else FAILED


@contextmanager
def _without_garbage_collection() -> Iterator[None]:
    """Pause garbage collection during imports, and exempt what is imported: it lives as long as the process.

    Otherwise it takes a third of the processor time of a short command, with that at the end of the process.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def _refused(message: str, code: int) -> int:
    print(f"spheretwin: {one_line(message)}", file=sys.stderr)
    return code


def _plain(arguments: Sequence[str]) -> Sequence[str]:
    """Return the arguments if they are safe in terminals and in files of other programs."""
    for argument in arguments:
        if not is_plain(argument):
            raise InputError(
                f"command line: expected text without control characters, received {shown(argument)}"
            )
    return arguments


def _is_help(options: argparse.Namespace) -> bool:
    """True if help is requested of a verb that runs a scenario; argparse prints the help of the others."""
    return getattr(options, "help", None) is not None


def _check_flags(arguments: Sequence[str], options: argparse.Namespace) -> None:
    """Refuse an unknown argument, a flag that is given twice, unless it is a list, and an empty value."""
    if options.fields and not options.has_fields:
        *names, last = options.parser.expected
        near = _near_flag(options.fields[0], options.parser.expected)
        raise InputError(
            f"command line: expected {', '.join(names)} or {last}, received {' '.join(options.fields)}{near}"
        )
    if options.has_fields:
        _check_options(options)
    flags = [argument.partition("=")[0].replace("_", "-") for argument in arguments if argument[:2] == "--"]
    for flag, count in Counter(flags).items():
        name = flag[2:].replace("-", "_")
        if count > 1 and not isinstance(getattr(options, name, None), list):
            raise InputError(f"command line: expected {flag} once, received it {count} times")
        if hasattr(options, name) and _is_empty(arguments, flag):
            raise InputError(f"command line: expected a value after {flag}, received an empty text")


def _check_options(options: argparse.Namespace) -> None:
    """Refuse a flag that is no field of a scenario, but resembles an option of the verb."""
    fields = import_module("spheretwin.scenario.sections").Scenario.model_fields
    valid = [*options.parser.expected, *(f"--{name.replace('_', '-')}" for name in fields)]
    for token in options.fields:
        flag = token.partition("=")[0].replace("_", "-")
        near = _near_flag(flag, valid) if "." not in flag else ""
        if near and flag not in valid:
            raise InputError(
                f"command line: expected an option or a field of the scenario, received {flag}{near}"
            )


def _near_flag(received: str, valid: Sequence[str]) -> str:
    """Return a hint at the flag nearest to a received one, or an empty text; dashes do not count."""
    names = {name[2:]: name for name in valid if name.startswith("--")}
    near = nearest(received[2:], names) if received.startswith("--") else None
    return f"; did you mean {names[near]}?" if near else ""


def _is_empty(arguments: Sequence[str], flag: str) -> bool:
    """True if a flag is followed by an empty text, as in ``--out ""`` or ``--out=``."""
    following = pairwise(arguments)
    return f"{flag}=" in arguments or (flag, "") in following


def _discard_stdout() -> None:
    """Prevent Python from flushing unwritable output at its exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _parser(arguments: Sequence[str]) -> Parser:
    """Return the parser of the command, with the arguments of the verb that is called."""
    parser = Parser(prog="spheretwin", description="Digital twin of a permanent-magnet spherical actuator.")
    parser.add_argument("--version", action="version", version=f"spheretwin {version('spheretwin')}")
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    parsers = {name: verbs.add_parser(name, help=text) for name, text in VERBS.items()}
    called = next((argument for argument in arguments if not argument.startswith("-")), None)
    if called in parsers:
        parsers[called].define(_verb(called))
    return parser


def _verb(name: str) -> Verb | dict[str, Verb]:
    """Return a verb, or its parts, from its module."""
    module = import_module(f"spheretwin.cli.{name}")
    return getattr(module, "PARTS", None) or module.run


def parsers_of(verb: str) -> dict[str, Parser]:
    """Return the parser of a verb, and those of its parts, by what is typed for each."""
    parser = Parser(prog=f"spheretwin {verb}")
    parser.define(_verb(verb))
    return {verb: parser, **{f"{verb} {name}": part for name, part in parser.parts().items()}}
