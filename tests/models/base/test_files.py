"""Output files: whole or not at all."""

import errno
import os
import stat

import pytest

from spheretwin.models.base.errors import InputError, SpheretwinError, without_breaks
from spheretwin.models.base.files import OutputFile, check_writable, regular_file, whole_file
from spheretwin.models.telemetry.parquet import PART_ROWS
from tests.models.telemetry.streams import streamed, table


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


def test_link_in_a_circle_is_bad_input(tmp_path):
    (loop := tmp_path / "loop.txt").symlink_to("loop.txt")
    with pytest.raises(InputError, match="circle"):
        check_writable(loop)
    assert loop.is_symlink()


def test_two_writers_of_one_path_each_leave_a_whole_file(tmp_path):
    path = tmp_path / "out.txt"
    with whole_file(path) as first:
        first.write_text("one")
        with whole_file(path) as second:
            second.write_text("two")
            first.write_text("one, at length")
        assert path.read_text() == "two"
    assert path.read_text() == "one, at length"
    assert os.listdir(tmp_path) == ["out.txt"]


def test_neighbours_whose_names_end_in_part_are_left_alone(tmp_path):
    neighbours = ["out.txt.part", f".out.txt.{os.getpid()}.part"]
    for name in neighbours:
        (tmp_path / name).write_text("mine")
    with whole_file(tmp_path / "out.txt") as temporary:
        temporary.write_text("new")
    assert sorted(os.listdir(tmp_path)) == sorted([*neighbours, "out.txt"])
    assert {(tmp_path / name).read_text() for name in neighbours} == {"mine"}


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_permissions_are_those_of_any_new_file(tmp_path, umask, mode):
    before = os.umask(umask)
    try:
        with whole_file(tmp_path / "out.txt") as temporary:
            temporary.write_text("new")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "out.txt").stat().st_mode) == mode


def test_permissions_of_a_replaced_file_stay(tmp_path):
    (path := tmp_path / "out.txt").write_text("old")
    path.chmod(0o640)
    with whole_file(path) as temporary:
        temporary.write_text("new")
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_pipe_is_no_place_for_a_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="output: expected"):
        check_writable(tmp_path / "pipe")
    check_writable(tmp_path / "out.txt")
    assert os.listdir(tmp_path) == ["pipe"]


def test_messages_name_the_requested_file_and_the_cause_without_its_number(tmp_path):
    path = tmp_path / "missing" / "run.rrd"
    with pytest.raises(InputError) as refused:
        OutputFile(path)
    assert f"{refused.value}" == f"output: expected a writable path, No such file or directory: {path}"
    target = tmp_path / "run.parquet"

    def fill_the_disk(named):
        with whole_file(target) as temporary:
            text = f"[Errno 28] Error writing bytes to '{temporary}'"
            raise OSError(errno.ENOSPC, text, str(temporary) if named else None)

    for named in (True, False):
        with pytest.raises(SpheretwinError) as failed:
            fill_the_disk(named)
        assert f"{failed.value}" == f"output: {target} could not be written, No space left on device"


def test_a_folder_that_came_in_between_is_told_and_the_file_stays(tmp_path):
    output = OutputFile(path := tmp_path / "out.txt")
    output.path.write_text("new")
    path.mkdir()
    with pytest.raises(SpheretwinError, match=r"output: .*out\.txt could not be written"):
        output.keep()
    assert output.path.read_text() == "new"


# The longest hidden name has 23 bytes more than the file's: two dots, 16 digits, ".part".
LONGEST = 255 - 23


def test_a_name_too_long_to_be_hidden_is_found_before_work_begins(tmp_path):
    for length in (LONGEST + 1, 300):
        with pytest.raises(InputError, match="output: expected a writable path"):
            check_writable(tmp_path / ("n" * length))
    check_writable(tmp_path / ("n" * LONGEST))
    with whole_file(tmp_path / ("n" * LONGEST)) as temporary:
        temporary.write_text("new")
    assert os.listdir(tmp_path) == ["n" * LONGEST]


def test_the_longest_name_leaves_room_for_the_parts_of_a_run(tmp_path):
    name = "n" * (LONGEST - len(".parquet")) + ".parquet"
    check_writable(path := tmp_path / name, ".parquet")
    streamed(path, table(PART_ROWS + 1), PART_ROWS + 1).close({})
    assert os.listdir(tmp_path) == [name]


def test_a_file_of_another_format_is_refused_by_its_name(tmp_path):
    check_writable(tmp_path / "run.parquet", ".parquet")
    for name in ("run.csv", "run.mat", "run.PARQUET", "run", ".parquet"):
        with pytest.raises(InputError, match=rf"expected a name that ends in \.parquet, received .*{name}$"):
            check_writable(tmp_path / name, ".parquet")


def test_an_input_without_an_end_is_refused_at_once(tmp_path):
    (tmp_path / "zero").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("1")
    (tmp_path / "link").symlink_to("file")
    assert regular_file(tmp_path / "link").read_text() == "1"
    kinds = {"zero": "a device", "pipe": "a named pipe", "folder": "a folder"}
    for name, kind in kinds.items():
        with pytest.raises(OSError, match=f"it is {kind}, not a regular file") as error:
            regular_file(tmp_path / name)
        assert without_breaks(error.value) == f"it is {kind}, not a regular file: {tmp_path / name}"
    with pytest.raises(FileNotFoundError):
        regular_file(tmp_path / "missing")
