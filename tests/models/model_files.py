"""Model files that differ from the shipped one in pieces of their text."""

from spheretwin.models import actuator as actuators


def edited_text(*edits):
    """Text of the shipped model for another folder, with pieces replaced."""
    text = actuators.MJCF_PATH.read_text(encoding="utf-8")
    for old, new in (('meshdir="assets"', f'meshdir="{actuators.FOLDER / "assets"}"'), *edits):
        assert old in text, old
        text = text.replace(old, new)
    return text


def edited(folder, *edits, name="mine.xml"):
    """Write the shipped model with pieces of its text replaced; return the path of the file."""
    (path := folder / name).write_text(edited_text(*edits), encoding="utf-8")
    return path
