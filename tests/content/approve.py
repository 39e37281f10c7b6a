"""Write the approved texts: ``python -m tests.content.approve [NAME...]``; without a name, of all cases."""

import sys

from tests import conftest as conftest  # sets the environment of the tests
from tests.content.compare import difference
from tests.content.content import EXPECTED, all_cases, expected_path, stable


def main(names: list[str]) -> None:
    cases = {name: case for of_file in all_cases().values() for name, case in of_file.items()}
    if unknown := set(names) - set(cases):
        sys.exit(f"expected names of cases, received {', '.join(sorted(unknown))}; valid: {', '.join(cases)}")
    for name in names or cases:
        path, text = expected_path(name), stable(cases[name]())
        # A text that is the same within the tolerance stays: numbers of another machine are no change.
        if not path.exists() or difference(path.read_text(encoding="utf-8"), text):
            path.write_text(text, encoding="utf-8")
            print(f"approved: {name}")
    if not names:
        for path in EXPECTED.glob("*.txt"):
            if path.stem not in cases:
                path.unlink()
                print(f"removed: {path.stem}")


if __name__ == "__main__":
    main(sys.argv[1:])
