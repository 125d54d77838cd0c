"""A file is the old one or the new one."""

import errno
import resource

import pytest

from anmstrip.results.files import atomic_write


@pytest.fixture
def target(tmp_path):
    path = tmp_path / "state.txt"
    path.write_text("old")
    return path


def test_the_new_file_appears_at_the_end(target):
    with atomic_write(target) as temporary:
        temporary.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert list(target.parent.iterdir()) == [target]


@pytest.mark.parametrize("failure", [RuntimeError, KeyboardInterrupt])
def test_a_failure_keeps_the_old_file_and_nothing_else(target, failure):
    with pytest.raises(failure), atomic_write(target) as temporary:
        temporary.write_text("half")
        raise failure
    assert target.read_text() == "old"
    assert list(target.parent.iterdir()) == [target]


def test_what_a_killed_writer_left_is_taken_away_by_the_next_one(target):
    with atomic_write(target) as temporary:
        temporary.write_text("new")
        name = temporary.name
    (target.parent / name).write_text("left by a killed process, and longer")
    with atomic_write(target) as temporary:
        temporary.write_text("newer")
    assert target.read_text() == "newer"
    assert list(target.parent.iterdir()) == [target]


def test_a_full_disk_is_reported_with_the_name_of_the_file(target):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError) as caught, atomic_write(target) as temporary:
            temporary.write_bytes(bytes(5000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (caught.value.errno, caught.value.filename) == (errno.EFBIG, str(target))
    assert target.read_text() == "old"


def test_a_missing_directory_is_reported_with_the_name_of_the_file(tmp_path):
    path = tmp_path / "nowhere" / "state.txt"
    with pytest.raises(FileNotFoundError) as caught, atomic_write(path) as temporary:
        temporary.write_text("new")
    assert caught.value.filename == str(path)
