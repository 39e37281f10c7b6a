"""Model files of tests: the shipped one with other numbers of its groups."""

import re

from spheretwin.models import actuator as actuators
from tests.models.model_files import edited

TEXT = actuators.MJCF_PATH.read_text()


def model_file(folder, **numbers):
    """Write the shipped model with other or more numbers, each a number or a list; return its path."""
    edits = []
    for name, value in numbers.items():
        data = " ".join(map(repr, value)) if isinstance(value, list) else value
        line = f'<numeric name="{name}" data="{data}"/>'
        shipped = re.search(rf'<numeric name="{name}" data="[^"]*"/>', TEXT)
        edits.append((shipped[0], line) if shipped else ("<custom>", f"<custom>{line}"))
    return str(edited(folder, *edits))
