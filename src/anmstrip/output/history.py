"""One row per accepted step, in a CSV file that can be read while it grows."""

import csv
import io
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from anmstrip.output.files import naming, replaced
from anmstrip.scene.errors import InputError, Mistake


class History:
    """A table with a header, that rows are added to.

    A row reaches the system in one piece before `append` returns, so that a killed process
    leaves complete lines.

    Parameters
    ----------
    path : path
        The `.csv`; replaced by a header alone.
    columns : sequence of str
        Names, in the order of the file.
    """

    def __init__(self, path: str | os.PathLike[str], columns: Sequence[str]) -> None:
        self.path = Path(path)
        self.columns = tuple(columns)
        self._rewrite([])

    @classmethod
    def reopened(cls, path: str | os.PathLike[str], columns: Sequence[str], rows: int) -> Self:
        """Go on after the first rows of an existing file; the others are dropped.

        Parameters
        ----------
        path : path
            The `.csv`.
        columns : sequence of str
            Those the file must have.
        rows : int
            How many rows to keep.

        Raises
        ------
        InputError
            The file has other columns or fewer rows.
        OSError
            The file cannot be read or written.
        """
        header, *kept = _records(Path(path)) or [[]]
        if header != list(columns):
            raise _refused(path, ", ".join(header), f"the columns {', '.join(columns)}")
        if len(kept) < rows:
            raise _refused(path, f"{len(kept)} rows", f"at least {rows} rows")
        history = cls.__new__(cls)
        history.path, history.columns = Path(path), tuple(columns)
        history._rewrite(kept[:rows])
        return history

    def append(self, row: Mapping[str, Any]) -> None:
        """Add a row.

        Parameters
        ----------
        row : mapping
            Numbers or text by column; a column left out, or None, stays empty.

        Raises
        ------
        ValueError
            A column that the table does not have.
        OSError
            The file cannot be written.
        """
        if unknown := set(row) - set(self.columns):
            raise ValueError(f"no such columns: {', '.join(sorted(unknown))}")
        line = _line(_cells(row, self.columns))
        with naming(self.path), self.path.open("ab") as file:
            file.write(line.encode())

    def _rewrite(self, rows: Iterable[Sequence[str]]) -> None:
        _replace(self.path, [self.columns, *rows])


def write(
    path: str | os.PathLike[str], columns: Sequence[str], rows: Iterable[Mapping[str, Any]]
) -> None:
    """Write a whole table at once; rows as for :meth:`History.append`."""
    _replace(path, [columns, *(_cells(row, columns) for row in rows)])


def _replace(path: str | os.PathLike[str], lines: Iterable[Sequence[str]]) -> None:
    with replaced(path) as temporary:
        temporary.write_bytes("".join(map(_line, lines)).encode())


def _cells(row: Mapping[str, Any], columns: Sequence[str]) -> list[str]:
    return [_text(row.get(column)) for column in columns]


def read(path: str | os.PathLike[str]) -> dict[str, NDArray[np.float64] | list[str]]:
    """Read a history, even while it grows.

    Returns
    -------
    dict
        By column: an array of floats, NaN where empty, or a list of str if not all are numbers.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    header, *rows = _records(Path(path)) or [[]]
    return {name: _column([row[k] for row in rows]) for k, name in enumerate(header)}


def _records(path: Path) -> list[list[str]]:
    complete, _, _ = path.read_bytes().rpartition(b"\n")
    return list(csv.reader(io.StringIO(complete.decode(), newline="")))


def _line(cells: Sequence[str]) -> str:
    buffer = io.StringIO(newline="")
    csv.writer(buffer, lineterminator="\n").writerow(cells)
    return buffer.getvalue()


def _text(value: object) -> str:
    """Shortest text that reads back as the same number; text on one line."""
    if value is None:
        return ""
    if isinstance(value, float | np.floating):
        return repr(float(value))
    return " ".join(str(value).splitlines())


def _column(cells: list[str]) -> NDArray[np.float64] | list[str]:
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError:
        return cells


def _refused(path: str | os.PathLike[str], found: str, expected: str) -> InputError:
    mistake = Mistake(
        file=str(path),
        key="",
        value=found,
        expected=expected,
        hint="the same command without --resume",
    )
    return InputError((mistake,))
