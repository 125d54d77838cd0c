"""A file is the old one or the new one."""

import errno
import os
import resource
import subprocess
import sys

import pytest

from anmstrip.errors import InputError
from anmstrip.results.files import DirectoryLock, atomic_write


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


HOLDER = """
import sys
from anmstrip.results.files import DirectoryLock
lock = DirectoryLock(sys.argv[1])
print("held", flush=True)
input()
"""


def test_one_run_at_a_time_writes_to_a_directory(tmp_path):
    held = DirectoryLock(tmp_path)
    with pytest.raises(InputError, match=f"in use by process {os.getpid()} on"):
        DirectoryLock(tmp_path)
    held.release()
    assert not list(tmp_path.iterdir())
    DirectoryLock(tmp_path).release()


def test_another_process_holds_a_directory_until_it_is_killed(tmp_path):
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path)], stdin=-1, stdout=-1, text=True
    ) as other:
        assert other.stdout.readline() == "held\n"
        with pytest.raises(InputError, match=f"in use by process {other.pid} on"):
            DirectoryLock(tmp_path)
        other.kill()
        other.wait()
        lock = DirectoryLock(tmp_path)  # what is left of it is of no consequence
        lock.check()
        lock.release()


def test_a_directory_that_was_emptied_or_replaced_is_noticed(tmp_path):
    directory = tmp_path / "results"
    directory.mkdir()
    lock = DirectoryLock(directory)
    lock.check()
    (directory / ".running").unlink()
    with pytest.raises(FileNotFoundError, match="taken away") as caught:
        lock.check()
    assert caught.value.filename == str(directory)
    second = DirectoryLock(directory)
    lock.release()  # which must not free the other's
    second.check()
    directory.rename(tmp_path / "elsewhere")
    with pytest.raises(FileNotFoundError, match="taken away"):
        second.check()
