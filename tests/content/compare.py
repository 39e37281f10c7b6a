"""Comparison of a text with the approved one: words exactly, numbers within a tolerance."""

import difflib
import math
import re

RELATIVE = 1e-6
"""Tolerance of a number with a decimal point or an exponent. Other processors and versions of libm round
functions and sums differently, by some 1e-15 of a value; short runs amplify that a thousand times, and single
precision, which recordings use, rounds at 6e-8. A wrong factor, sign, row or column changes at least one
number of a text by more than a millionth."""

ABSOLUTE = 1e-12
"""Rounding noise of a number whose exact value is zero."""

MOST_LINES = 40
"""Lines of a difference that a failure shows."""

NUMBER = re.compile(r"(?<![\w#.])([-+]?\d+(?:\.\d+)?(?:e[-+]?\d{1,3}(?!\w))?)")
"""A number that does not begin within a word, a colour or a version."""


def same_number(expected: str, actual: str) -> bool:
    """True if two numbers are equal within the tolerance; whole numbers are compared exactly."""
    if expected == actual:
        return True
    if expected.lstrip("+-").isdigit() and actual.lstrip("+-").isdigit():
        return int(expected) == int(actual)
    return math.isclose(float(expected), float(actual), rel_tol=RELATIVE, abs_tol=ABSOLUTE)


def same_line(expected: str, actual: str) -> bool:
    """True if the words of two lines are equal and their numbers are equal within the tolerance."""
    if expected == actual:
        return True
    parts = NUMBER.split(expected), NUMBER.split(actual)
    if len(parts[0]) != len(parts[1]) or parts[0][::2] != parts[1][::2]:
        return False
    return all(map(same_number, parts[0][1::2], parts[1][1::2]))


def difference(expected: str, actual: str) -> str:
    """Return the first differing lines as a unified diff; an empty text if the texts are the same."""
    wanted, received = expected.splitlines(), actual.splitlines()
    if len(wanted) == len(received) and all(map(same_line, wanted, received)):
        return ""
    # A line within the tolerance is shown as the approved one, so that it is no difference.
    shapes: dict[str, list[str]] = {}
    for line in wanted:
        shapes.setdefault(NUMBER.sub("#", line), []).append(line)
    adapted = [
        next((near for near in shapes.get(NUMBER.sub("#", line), []) if same_line(near, line)), line)
        for line in received
    ]
    lines = list(difflib.unified_diff(wanted, adapted, "approved", "received", n=1, lineterm=""))
    rest = [f"and {len(lines) - MOST_LINES} lines more"] if len(lines) > MOST_LINES else []
    return "\n".join([*lines[:MOST_LINES], *rest]) or "the order of the lines differs"
