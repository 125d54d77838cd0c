"""Files that are either the old ones or the new ones, whenever the process is killed."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


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
