"""The list of states is readable at any moment."""

import errno
import os
import random
import subprocess
import sys
import time

import numpy as np
import pytest

from anmstrip.errors import InputError
from anmstrip.results.vtk import Collection, Entry, read_collection, read_surface

WRITER = """
import sys
import numpy as np
from anmstrip.results.vtk import Collection, write_surface
u, v = (grid.ravel() for grid in np.meshgrid(np.arange(100.0), np.arange(100.0)))
first = (np.arange(99) + 100 * np.arange(99)[:, None]).reshape(-1, 1)
cells = first + np.array([0, 1, 101, 100])
contents = Collection(sys.argv[1] + "/strip.pvd")
noise = np.random.default_rng(0).random((10000, 3))
for k in range(100000):
    name = f"strip_{k % 3}.vtu"
    write_surface(sys.argv[1] + "/" + name, np.column_stack([u, v, 0 * u + k]), cells, {"v": noise})
    contents.add(k, name)
    print(k, flush=True)
"""


def test_vtk_reads_the_states_in_time(run):
    pyvista = pytest.importorskip("pyvista", exc_type=ImportError)
    reader = pyvista.get_reader(run / "strip.pvd")
    assert reader.time_values == [0.0, 0.5, 1.0]
    reader.set_active_time_value(1.0)
    (grid,) = reader.read()
    np.testing.assert_array_equal(grid.points, read_surface(run / "strip_2.vtu").points)
    assert grid.points[:, 2].min() < -0.5


def test_times_are_kept_to_the_last_bit(tmp_path):
    contents = Collection(tmp_path / "strip.pvd")
    times = [0.0, 0.1 + 0.2, 1.0 / 3.0, 1e300]
    for k, value in enumerate(times):
        contents.add(np.float64(value), tmp_path / f"strip_{k}.vtu")
    assert read_collection(tmp_path / "strip.pvd") == tuple(
        Entry(value, f"strip_{k}.vtu") for k, value in enumerate(times)
    )


def test_a_resumed_run_forgets_what_came_after_its_checkpoint(run):
    contents = Collection(run / "strip.pvd", until_time=0.5)
    assert [entry.time for entry in read_collection(run / "strip.pvd")] == [0.0, 0.5]
    contents.add(0.75, "strip_9.vtu")
    assert [entry.time for entry in read_collection(run / "strip.pvd")] == [0.0, 0.5, 0.75]


def test_a_run_killed_before_its_first_state_can_be_resumed(tmp_path):
    contents = Collection(tmp_path / "strip.pvd", until_time=-1.0)
    assert (contents.count, contents.last) == (0, None)
    assert read_collection(tmp_path / "strip.pvd") == ()


@pytest.mark.parametrize("gone", ["strip.pvd", "strip_1.vtu"])
def test_files_that_are_gone_are_named(run, gone):
    (run / gone).unlink()
    with pytest.raises(InputError) as caught:
        Collection(run / "strip.pvd", until_time=0.5)
    assert f"{gone}\n" in str(caught.value)
    assert "no such file" in str(caught.value)


@pytest.mark.parametrize("content", ["", "<VTKFile>", '<V><DataSet file="a"/></V>'])
def test_a_damaged_list_is_an_input_error(tmp_path, content):
    (tmp_path / "strip.pvd").write_text(content)
    with pytest.raises(InputError, match="without --resume"):
        Collection(tmp_path / "strip.pvd", until_time=1.0)


def test_a_list_is_extended_by_its_line_alone(tmp_path, monkeypatch):
    """Whatever the length: one write of a line and of what closes the list."""
    contents, written = Collection(tmp_path / "strip.pvd"), []
    contents.add(0.0, "strip_0.vtu")
    monkeypatch.setattr(Collection, "_write", None)  # the whole list is not written again
    for k in range(1, 300):
        before = (tmp_path / "strip.pvd").stat().st_size
        contents.add(float(k), f"strip_{k:05d}.vtu")
        written.append((tmp_path / "strip.pvd").stat().st_size - before)
    assert max(written) < 100
    assert [entry.time for entry in read_collection(tmp_path / "strip.pvd")] == [*range(300)]


def test_a_full_disk_leaves_the_list_as_it_was(tmp_path, monkeypatch):
    contents = Collection(tmp_path / "strip.pvd")
    contents.add(0.0, "strip_0.vtu")
    contents.add(1.0, "strip_1.vtu")
    before = (tmp_path / "strip.pvd").read_bytes()
    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(OSError, match=r"strip\.pvd"):
        contents.add(2.0, "strip_2.vtu")
    assert (tmp_path / "strip.pvd").read_bytes() == before


def refuse(_):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_list_that_was_taken_away_is_missed(tmp_path):
    contents = Collection(tmp_path / "strip.pvd")
    contents.add(0.0, "strip_0.vtu")
    (tmp_path / "strip.pvd").unlink()
    with pytest.raises(FileNotFoundError, match=r"strip\.pvd"):
        contents.add(1.0, "strip_1.vtu")


def test_a_kill_at_any_instant_leaves_every_listed_state_readable(tmp_path):
    chance = random.Random(1)
    for attempt in range(6):
        folder = tmp_path / str(attempt)
        folder.mkdir()
        command = [sys.executable, "-c", WRITER, str(folder)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None
            for number in range(chance.randint(1, 4)):
                assert writer.stdout.readline() == f"{number}\n"
            time.sleep(chance.uniform(0.0, 0.02))
            writer.kill()
        entries = read_collection(folder / "strip.pvd")
        assert entries
        for file in {entry.file for entry in entries}:
            surface = read_surface(folder / file)
            assert surface.cells.shape == (99 * 99, 4)
            assert surface.fields["v"].shape == (10000, 3)
