"""A row per step, complete lines only, numbers to the last bit."""

import csv

import numpy as np
import pytest

from anmstrip.errors import InputError
from anmstrip.results.files import History, read_history

COLUMNS = ("stage", "time", "step", "r1_drag")


@pytest.fixture
def path(tmp_path):
    """A history of four steps."""
    history = History(tmp_path / "history.csv", COLUMNS)
    for step in range(4):
        history.append({"stage": "turn", "time": 0.1 * step, "step": step, "r1_drag": -1.0 / 3.0})
    return history.path


def test_floats_are_kept_to_the_last_bit(tmp_path):
    history = History(tmp_path / "history.csv", ["time"])
    values = [0.1 + 0.2, np.float64(1.0) / 3.0, -0.0, 5e-324, 1.7976931348623157e308, np.inf]
    for value in values:
        history.append({"time": value})
    np.testing.assert_array_equal(read_history(history.path)["time"], values)


def test_other_programs_read_the_file(path):
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    assert rows[3] == {
        "stage": "turn",
        "time": repr(0.1 * 3),
        "step": "3",
        "r1_drag": repr(-1.0 / 3.0),
    }


def test_some_rows_are_those_of_all(path):
    """Numbers and text, in the order of the file."""
    table, some = read_history(path), read_history(path, {3, 1})
    assert some["stage"] == table["stage"][1::2]
    np.testing.assert_array_equal(some["time"], table["time"][[1, 3]])


def test_missing_values_are_empty(tmp_path):
    history = History(tmp_path / "history.csv", COLUMNS)
    history.append({"stage": "wrap", "step": np.int64(1), "time": None})
    assert history.path.read_text() == "stage,time,step,r1_drag\nwrap,,1,\n"
    table = read_history(history.path)
    assert np.isnan(table["time"][0])
    assert np.isnan(table["r1_drag"][0])


@pytest.mark.parametrize("name", ["wrap, then turn", 'the "first"', "µ é", "two\nlines\r\nof it"])
def test_text_stays_in_its_cell(tmp_path, name):
    history = History(tmp_path / "history.csv", COLUMNS)
    history.append({"stage": name, "time": 1.0})
    history.append({"stage": "next", "time": 2.0})
    assert read_history(history.path)["stage"] == [" ".join(name.splitlines()), "next"]
    assert history.path.read_bytes().count(b"\n") == 3


def test_a_row_is_on_disk_when_append_returns(tmp_path):
    history = History(tmp_path / "history.csv", COLUMNS)
    for step in range(3):
        history.append({"step": step})
        assert list(read_history(history.path)["step"]) == list(range(step + 1))


@pytest.mark.parametrize("half", ["turn,0.4", "turn,0.4,4,1.25", '"turn'])
def test_a_line_that_was_cut_is_not_read_and_not_kept(path, half):
    with path.open("a") as file:
        file.write(half)
    assert list(read_history(path)["step"]) == [0, 1, 2, 3]
    History(path, COLUMNS, 4).append({"step": 9})
    assert list(read_history(path)["step"]) == [0, 1, 2, 3, 9]


@pytest.mark.parametrize("rows", [0, 2, 4])
def test_reopening_keeps_the_first_rows_as_they_were(path, rows):
    before = path.read_text().splitlines()
    history = History(path, COLUMNS, rows)
    assert path.read_text().splitlines() == before[: rows + 1]
    history.append({"step": 7})
    assert list(read_history(path)["step"]) == [*range(rows), 7]


@pytest.mark.parametrize(
    ("columns", "rows", "about"),
    [(COLUMNS, 5, "at least 5 rows"), (("stage", "time"), 1, "the columns stage, time")],
)
def test_a_history_of_another_run_is_refused(path, columns, rows, about):
    before = path.read_text()
    with pytest.raises(InputError, match=about):
        History(path, columns, rows)
    assert path.read_text() == before


def test_an_unknown_column_is_refused(path):
    before = path.read_text()
    history = History(path, COLUMNS, 4)
    with pytest.raises(ValueError, match="r2_drag"):
        history.append({"r2_drag": 1.0})
    assert path.read_text() == before


def test_a_full_disk_is_reported_with_the_name_of_the_file(tmp_path):
    history = History(tmp_path / "history.csv", COLUMNS)
    history.path.unlink()
    history.path.symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left") as caught:
        history.append({"step": 1})
    assert caught.value.filename == str(history.path)


@pytest.mark.parametrize("row", ["3", "3,4,5"])
def test_a_row_of_another_length_is_named(tmp_path, row):
    path = tmp_path / "table.csv"
    path.write_text(f"a,b\n1,2\n{row}\n")
    with pytest.raises(InputError, match="rows of 2 cells") as caught:
        read_history(path)
    assert row in str(caught.value) and str(path) in str(caught.value)
