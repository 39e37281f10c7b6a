"""Model files that differ from the shipped one in pieces of their text."""

from spheretwin.models import actuator as actuators


def edited(folder, *edits, name="mine.xml"):
    """Write the shipped model with pieces of its text replaced; return the path of the file."""
    text = actuators.MJCF_PATH.read_text(encoding="utf-8")
    for old, new in (('meshdir="assets"', f'meshdir="{actuators.FOLDER / "assets"}"'), *edits):
        assert old in text
        text = text.replace(old, new)
    (path := folder / name).write_text(text, encoding="utf-8")
    return path
