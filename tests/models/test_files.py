"""Output files: whole or not at all."""

import os

import pytest

from spheretwin.models.errors import InputError, SpheretwinError
from spheretwin.models.files import check_writable, whole_file


def test_file_appears_when_the_block_ends(tmp_path):
    path = tmp_path / "out.txt"
    with whole_file(path) as temporary:
        temporary.write_text("new")
        assert not path.exists()
    assert path.read_text() == "new"
    assert os.listdir(tmp_path) == ["out.txt"]


@pytest.mark.parametrize(
    ("raised", "seen"), [(OSError("disk full"), SpheretwinError), (KeyError("x"), KeyError)]
)
def test_failure_leaves_what_was_there(tmp_path, raised, seen):
    (path := tmp_path / "out.txt").write_text("old")

    def fail_halfway():
        with whole_file(path) as temporary:
            temporary.write_text("half")
            raise raised

    with pytest.raises(seen):
        fail_halfway()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["out.txt"]


def test_link_stays_a_link(tmp_path):
    (tmp_path / "real.txt").write_text("old")
    (link := tmp_path / "link.txt").symlink_to("real.txt")
    with whole_file(link) as temporary:
        temporary.write_text("new")
    assert link.is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


def test_places_where_no_file_can_be_put(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "missing" / "out.txt", tmp_path / "pipe"):
        with pytest.raises(InputError, match="output: expected"):
            check_writable(path)
    check_writable(tmp_path / "out.txt")
    assert os.listdir(tmp_path) == ["pipe"]
