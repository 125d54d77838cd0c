"""Files of a run: summary, checkpoint and history, each written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import json
import math
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any
import numpy as np
import io
from numpy.typing import ArrayLike, NDArray
from anmstrip.errors import InputError, Mistake
import csv
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self
from numpy.typing import NDArray

@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Let an `OSError` leave with the name of the file that the user knows.

    A full disk is reported by the system without any name, and a refused permission with the
    name of a temporary file.
    """
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error


@contextmanager
def replaced(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Replace a file all at once.

    The body writes to the temporary path that it is given, in the same directory.  When it
    succeeds, the temporary file is flushed to the disk and renamed over `path`; when it fails,
    it is removed.  There is one temporary name per file, so that what a killed process leaves
    behind is overwritten by the next one instead of piling up.

    Parameters
    ----------
    path : path
        The file to create or to replace.

    Yields
    ------
    pathlib.Path
        Where to write meanwhile.

    Raises
    ------
    OSError
        Disk full, permission refused, directory missing: with `path` as its `filename`.

    Examples
    --------
    >>> import tempfile
    >>> target = Path(tempfile.mkdtemp()) / "note.txt"
    >>> with replaced(target) as temporary:
    ...     _ = temporary.write_text("all or nothing")
    >>> target.read_text()
    'all or nothing'
    """
    target = Path(path)
    temporary = target.with_name(f".{target.name}.part")
    with naming(target):
        try:
            yield temporary
            _flush_to_disk(temporary)
            temporary.replace(target)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


def _flush_to_disk(path: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def write_summary(path: str | os.PathLike[str], summary: Mapping[str, Any]) -> None:
    """Write a summary, all at once.

    Parameters
    ----------
    path : path
        The `.json`.
    summary : mapping
        Numbers, text, paths, NumPy scalars and arrays, lists and mappings of them.  NaN and
        infinity, which JSON does not have, become null.

    Raises
    ------
    OSError
        The file cannot be written.
    TypeError
        Something else among the values.
    """
    text = json.dumps(plain(summary), indent=2, ensure_ascii=False, allow_nan=False)
    with replaced(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def plain(value: Any, *, keep_nonfinite: bool = False) -> Any:
    """Turn a value into what JSON knows.

    Parameters
    ----------
    value : object
        See `write`.
    keep_nonfinite : bool
        Leave NaN and infinity as they are, for readers that understand Python's spelling.

    Examples
    --------
    >>> plain({"drag": np.float64(2.5), "wrap": np.array([1, np.inf])})
    {'drag': 2.5, 'wrap': [1.0, None]}
    """

    def inner(item: Any) -> Any:
        return plain(item, keep_nonfinite=keep_nonfinite)

    if isinstance(value, np.ndarray | np.generic):
        return inner(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): inner(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [inner(item) for item in value]
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, float) and not (keep_nonfinite or math.isfinite(value)):
        return None
    return value


_FACTS, _ARRAY = "facts", "array/"


def save_checkpoint(
    path: str | os.PathLike[str], arrays: Mapping[str, ArrayLike], facts: Mapping[str, Any]
) -> None:
    """Write a checkpoint; a kill at any instant leaves the old one or the new one.

    Parameters
    ----------
    path : path
        The `.npz`.
    arrays : mapping of str to array
        Kept to the last bit.
    facts : mapping
        Numbers, text, lists and mappings of them, as JSON knows them.

    Raises
    ------
    OSError
        The file cannot be written.
    TypeError
        A fact that JSON does not know, or an array of objects.
    """
    contents: dict[str, Any] = {
        _ARRAY + name: np.asarray(values) for name, values in arrays.items()
    }
    if objects := [name for name, values in contents.items() if values.dtype.hasobject]:
        raise TypeError(f"arrays of objects cannot be kept: {', '.join(objects)}")
    text = json.dumps(plain(facts, keep_nonfinite=True)).encode()
    contents[_FACTS] = np.frombuffer(text, dtype=np.uint8)
    with replaced(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **contents)


def load_checkpoint(path: str | os.PathLike[str]) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Read a checkpoint.

    Returns
    -------
    arrays, facts : dict
        As they were saved; facts are lists, numbers and text.

    Raises
    ------
    InputError
        There is no checkpoint, or it is damaged.
    OSError
        The file cannot be read.
    """
    try:
        content = Path(path).read_bytes()
    except FileNotFoundError as error:
        raise _damaged_checkpoint(path, "no such file") from error
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            found = {name: archive[name] for name in archive.files}
        facts = json.loads(found.pop(_FACTS).tobytes())
    except Exception as error:  # damage shows as exceptions of any kind
        raise _damaged_checkpoint(path, f"damaged ({error})") from error
    return {name.removeprefix(_ARRAY): values for name, values in found.items()}, facts


def _damaged_checkpoint(path: str | os.PathLike[str], found: str) -> InputError:
    mistake = Mistake(
        file=str(path),
        key="",
        value=found,
        expected="the checkpoint that an interrupted run left",
        hint="the same command without --resume, to start from the beginning",
    )
    return InputError((mistake,))


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
            raise _damaged_history(path, ", ".join(header), f"the columns {', '.join(columns)}")
        if len(kept) < rows:
            raise _damaged_history(path, f"{len(kept)} rows", f"at least {rows} rows")
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


def write_table(
    path: str | os.PathLike[str], columns: Sequence[str], rows: Iterable[Mapping[str, Any]]
) -> None:
    """Write a whole table at once; rows as for :meth:`History.append`."""
    _replace(path, [columns, *(_cells(row, columns) for row in rows)])


def _replace(path: str | os.PathLike[str], lines: Iterable[Sequence[str]]) -> None:
    with replaced(path) as temporary:
        temporary.write_bytes("".join(map(_line, lines)).encode())


def _cells(row: Mapping[str, Any], columns: Sequence[str]) -> list[str]:
    return [_text(row.get(column)) for column in columns]


def read_history(path: str | os.PathLike[str]) -> dict[str, NDArray[np.float64] | list[str]]:
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


def _damaged_history(path: str | os.PathLike[str], found: str, expected: str) -> InputError:
    mistake = Mistake(
        file=str(path),
        key="",
        value=found,
        expected=expected,
        hint="the same command without --resume",
    )
    return InputError((mistake,))
