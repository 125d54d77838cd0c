"""Files of a run: summary, checkpoint and tables, each written whole or not at all."""

from __future__ import annotations

import csv
import errno
import io
import json
import math
import os
import platform
import weakref
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path, PurePath
from tempfile import TemporaryFile
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anmstrip.errors import InputError, Mistake, Named

AnyPath = str | os.PathLike[str]

_FACTS, _ARRAY = "facts", "array/"

START_AFRESH = "the same command without --resume, to start from the beginning"
"""Advice for a run that cannot be resumed."""

ROWS_AT_ONCE = 10_000
"""Lines of a table whose text is in memory at a time: it is ten times as large as the numbers."""

ERROR_WORDS = {
    "path": "the path",
    "time": "the steps in time",
    "mesh": "the mesh",
    "regularisation": "the laws of contact and friction",
    "flow": "the flow's dependence on its rate",
}
"""Parts of ``errors`` in ``summary.json``, as they are called in reports."""


ERROR_HEADS = {
    "tension": "tension (N/m)",
    "force": "roller's force (N)",
    "position": "position (m)",
    "moment": "moment (N)",
    "curl": "curl (1/m)",
}
"""Kind of error → how it is called, with its unit; moments are those of clamped edges, curls of
strip that can yield those behind rollers, or the largest without any."""


def error_rows(errors: Mapping[str, Mapping[str, float] | None]) -> tuple[list[str], list[Any]]:
    """Return the heads of a table of ``errors``, and its rows."""
    known = [part for part in errors.values() if part is not None]
    kinds = [kind for kind in ERROR_HEADS if any(kind in part for part in known)]
    parts = ((ERROR_WORDS[name], part or {}) for name, part in errors.items())
    rows = [
        [name, *(f"{part[kind]:.2g}" if kind in part else "–" for kind in kinds)]
        for name, part in parts
    ]
    return ["of", *(ERROR_HEADS[kind] for kind in kinds)], rows


@contextmanager
def named_errors(path: Path) -> Iterator[None]:
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
def atomic_write(path: AnyPath) -> Iterator[Path]:
    """Create or replace a file all at once.

    The body writes to the temporary path that it is given, in the same directory.  When it
    succeeds, the temporary file is flushed to the disk and renamed over `path`; when it fails,
    it is removed.  There is one temporary name per file, so that what a killed process leaves
    behind is overwritten by the next one instead of piling up.

    Raises
    ------
    OSError
        Disk full, permission refused, directory missing: with `path` as its `filename`.

    Examples
    --------
    >>> import tempfile
    >>> target = Path(tempfile.mkdtemp()) / "note.txt"
    >>> with atomic_write(target) as temporary:
    ...     _ = temporary.write_text("all or nothing")
    >>> target.read_text()
    'all or nothing'
    """
    target = Path(path)
    temporary = target.with_name(f".{target.name}.part")
    with named_errors(target):
        try:
            yield temporary
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())
            temporary.replace(target)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


def make_directory(path: AnyPath) -> Path:
    """Make the directory that results go into, if it is not there yet, and return it.

    Raises
    ------
    InputError
        It cannot be made or written.
    """
    directory = Path(path)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=directory):
            pass
    except OSError as error:
        expected = f"a directory that can be made and written ({error.strerror})"
        hint = "another directory for the results, as -o does"
        raise InputError([Mistake(str(directory), "", None, expected, hint)]) from error
    return directory


class DirectoryLock:
    """A directory to which one run at a time writes; a killed process leaves it free.

    The system holds the lock, on a file in the directory, as long as the process lives.  As a
    context it is let go by an error, whose traceback may live on, as in a notebook.

    Parameters
    ----------
    directory : path

    Raises
    ------
    InputError
        Another run, in this process or another one, writes there.
    OSError
        The directory cannot be written.
    """

    def __init__(self, directory: AnyPath) -> None:
        self.path = Path(directory) / ".running"
        with named_errors(self.path):
            while True:
                self.file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
                if not take_lock(self.file):
                    given = os.read(self.file, 200).decode(errors="replace")
                    os.close(self.file)
                    expected = "a directory to which no other run writes"
                    hint = "-o with another directory, or the same command when that run has ended"
                    if f"process {os.getpid()} on {platform.node()}" in given:
                        hint = "run.interrupted() of the run in this Python, or another directory"
                    raise InputError([Mistake(str(self.path.parent), "", given, expected, hint)])
                if _is_file(self.path, self.file):  # no other run has ended just now
                    break
                os.close(self.file)
            self.release = weakref.finalize(self, _unlock, self.path, self.file)
            os.truncate(self.file, 0)
            os.write(self.file, f"in use by process {os.getpid()} on {platform.node()}".encode())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None and issubclass(kind, Exception):
            self.release()

    def check(self) -> None:
        """Refuse to go on writing to a directory that was emptied or replaced.

        Raises
        ------
        FileNotFoundError
            With the directory as its `filename`.
        """
        if self.release.alive and not _is_file(self.path, self.file):
            words = "the files of this run were taken away"
            raise FileNotFoundError(errno.ENOENT, words, str(self.path.parent))


def take_lock(file: int) -> bool:
    """Return whether an open file could be locked, or cannot be where there are no locks.

    Some file systems have none, nor has Windows.
    """
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (ImportError, OSError) as error:
        return not isinstance(error, BlockingIOError)
    return True


def _is_file(path: Path, file: int) -> bool:
    """Return whether a path leads to an open file."""
    try:
        return os.path.samestat(path.stat(), os.fstat(file))
    except FileNotFoundError:
        return False


def _unlock(path: Path, file: int) -> None:
    """Let others write to a directory, unless it is theirs already."""
    if _is_file(path, file):
        path.unlink()
    os.close(file)


def plain(value: Any, *, keep_nonfinite: bool = False) -> Any:
    """Turn numbers, text, paths, arrays, and lists and mappings of them into what JSON knows.

    NaN and infinity become None, unless a reader understands Python's spelling of them.

    Examples
    --------
    >>> plain({"drag": np.float64(2.5), "wrap": np.array([1, np.inf])})
    {'drag': 2.5, 'wrap': [1.0, None]}
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float):
        return value if keep_nonfinite or math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(k): plain(v, keep_nonfinite=keep_nonfinite) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, keep_nonfinite=keep_nonfinite) for item in value]
    if isinstance(value, PurePath):
        return str(value)
    return value


def write_summary(path: AnyPath, summary: Mapping[str, Any]) -> None:
    """Write a `.json` of what :func:`plain` takes, all at once.

    Raises
    ------
    OSError
        The file cannot be written.
    TypeError
        Something else among the values.
    """
    text = json.dumps(plain(summary), indent=2, ensure_ascii=False, allow_nan=False)
    with atomic_write(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def read_json(path: Path) -> dict[str, Any] | None:
    """Return the table in a file, or None if there is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None


def save_checkpoint(
    path: AnyPath, arrays: Mapping[str, ArrayLike], facts: Mapping[str, Any]
) -> None:
    """Write a `.npz`; a kill at any instant leaves the old one or the new one.

    Parameters
    ----------
    path : path
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
    contents: dict[str, Any] = {_ARRAY + name: np.asarray(a) for name, a in arrays.items()}
    if objects := [name for name, values in contents.items() if values.dtype.hasobject]:
        raise TypeError(f"arrays of objects cannot be kept: {', '.join(objects)}")
    text = json.dumps(plain(facts, keep_nonfinite=True)).encode()
    contents[_FACTS] = np.frombuffer(text, dtype=np.uint8)
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **contents)


def load_checkpoint(path: AnyPath) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Read arrays and facts as they were saved; facts are lists, numbers and text.

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
        raise refused_checkpoint(path, "no such file") from error
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            found = {name: archive[name] for name in archive.files}
        facts = json.loads(found.pop(_FACTS).tobytes())
    except Exception as error:  # damage shows as exceptions of any kind
        raise refused_checkpoint(path, f"damaged ({error})") from error
    return {name.removeprefix(_ARRAY): values for name, values in found.items()}, facts


def refused_checkpoint(path: AnyPath, found: str) -> InputError:
    """Return the error of a checkpoint that no run has written."""
    expected = "the checkpoint that an interrupted run left"
    return InputError([Mistake(str(path), "", found, expected, START_AFRESH)])


class History:
    """A table with a header, that rows are added to.

    A row reaches the system in one piece before `append` returns, so that a killed process
    leaves complete lines.

    Parameters
    ----------
    path : path
        The `.csv`; replaced by the header and the rows that are kept.
    columns : sequence of str
        Names, in the order of the file.
    rows : int
        How many rows of an existing file are kept.

    Attributes
    ----------
    rows : int
        How many it has.

    Raises
    ------
    InputError
        The existing file has other columns or fewer rows.
    OSError
        The file cannot be read or written.
    """

    def __init__(self, path: AnyPath, columns: Sequence[str], rows: int = 0) -> None:
        self.path, self.columns, self.rows = Path(path), tuple(columns), rows
        header, *kept = _records(path) if rows and self.path.exists() else [list(columns)]
        given, expected = ", ".join(header), f"the columns {', '.join(columns)}"
        if header == list(columns):
            given, expected = f"{len(kept)} rows", f"at least {rows} rows"
        if header != list(columns) or len(kept) < rows:
            hint = "the same command without --resume"
            raise InputError([Mistake(str(path), "", given, expected, hint)])
        with atomic_write(path) as temporary:
            temporary.write_bytes(_encode([columns, *kept[:rows]]))

    def append(self, row: Mapping[str, Any]) -> None:
        """Add numbers or text by column; a column left out, or None, stays empty.

        Raises
        ------
        ValueError
            A column that the table does not have.
        OSError
            The file cannot be written.
        """
        self.extend({column: [value] for column, value in row.items()})

    def extend(self, table: Mapping[str, Sequence[Any] | NDArray[np.float64]]) -> None:
        """Add several rows in one piece, by columns; NaN in an array makes an empty cell."""
        if unknown := table.keys() - set(self.columns):
            raise ValueError(f"no such columns: {', '.join(sorted(unknown))}")
        count = max(map(len, table.values()), default=0)
        cells = (_cells(table.get(name, [None] * count)) for name in self.columns)
        lines = _encode(zip(*cells, strict=True))
        with named_errors(self.path), self.path.open("rb+") as file:  # not made anew
            file.seek(0, os.SEEK_END)
            file.write(lines)
        self.rows += count


def write_table(path: AnyPath, columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> None:
    """Write a whole table at once; rows as for :meth:`History.append`."""
    with atomic_write(path) as temporary:
        cells = (_cells([row.get(column) for column in columns]) for row in rows)
        temporary.write_bytes(_encode([columns, *cells]))


def read_history(
    path: AnyPath, rows: Container[int] | None = None
) -> dict[str, NDArray[np.float64] | list[str]]:
    """Read the columns of a table, even while it grows.

    Parameters
    ----------
    path : path
    rows : container of int, optional
        Numbers of the rows to read, instead of all; cells hold no line breaks then.

    Returns
    -------
    dict
        By column: an array of floats, NaN where empty, or a list of str if not all are numbers.

    Raises
    ------
    InputError
        A row has more cells than the header, or fewer.
    OSError
        The file cannot be read.
    """
    with Path(path).open(encoding="utf-8", newline="") as file:
        lines = (line for line in file if line.endswith("\n"))
        header = next(csv.reader(lines), [])
        records = csv.reader(line for n, line in enumerate(lines) if rows is None or n in rows)
        parts: list[list[Any]] = [[] for _ in header]
        while some := list(islice(records, ROWS_AT_ONCE)):
            if {len(row) for row in some} != {len(header)}:
                expected = f"rows of {len(header)} cells, as the header has"
                short = next(row for row in some if len(row) != len(header))
                hint = "the run again, or the file without that row"
                raise InputError([Mistake(str(path), "", ",".join(short), expected, hint)])
            for part, cells in zip(parts, zip(*some, strict=True), strict=True):
                part.append(_numbers(cells))
    table = Named[NDArray[np.float64] | list[str]]()
    for place, (name, part) in enumerate(zip(header, parts, strict=True)):
        if all(isinstance(cells, np.ndarray) for cells in part):
            table[name] = np.concatenate([np.zeros(0), *part])
        else:
            kept = (r for n, r in enumerate(_records(path)[1:]) if rows is None or n in rows)
            table[name] = [row[place] for row in kept]
    return table


def _numbers(cells: Sequence[str]) -> NDArray[np.float64] | None:
    """Return a column of numbers, NaN where it is empty, or None if one is no number."""
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError:
        return None


def _records(path: AnyPath) -> list[list[str]]:
    """Return the cells of the complete lines of a table, its header first."""
    complete, _, _ = Path(path).read_bytes().rpartition(b"\n")
    return list(csv.reader(io.StringIO(complete.decode(errors="replace"), newline=""))) or [[]]


def _cells(values: Sequence[Any] | NDArray[np.float64]) -> list[Any]:
    """Return what is written of values: texts on one line, and nothing for NaN in an array."""
    if isinstance(values, np.ndarray):
        found = values.astype(object)
        found[np.isnan(values)] = ""
        return list(found)
    return [" ".join(x.splitlines()) if isinstance(x, str) else x for x in values]


def _encode(rows: Iterable[Sequence[object]]) -> bytes:
    """Return lines of CSV: numbers that read back to the last bit."""
    buffer = io.StringIO(newline="")
    csv.writer(buffer, lineterminator="\n").writerows(rows)
    return buffer.getvalue().encode()
