"""Model files of tests: the shipped one with other numbers of its groups."""

import re

from spheretwin.models import actuator as actuators


def model_file(folder, **numbers):
    """Write the shipped model with other or more numbers, each a number or a list; return its path."""
    text = actuators.MJCF_PATH.read_text()
    for name, value in numbers.items():
        data = " ".join(map(repr, value)) if isinstance(value, list) else value
        line = f'<numeric name="{name}" data="{data}"/>'
        text, count = re.subn(rf'<numeric name="{name}" data="[^"]*"/>', line, text)
        if not count:
            text = text.replace("<custom>", f"<custom>{line}")
    (path := folder / "mine.xml").write_text(
        text.replace('meshdir="assets"', f'meshdir="{actuators.FOLDER}/assets"')
    )
    return str(path)
