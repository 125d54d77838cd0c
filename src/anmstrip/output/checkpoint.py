"""What a run needs to go on after it was interrupted."""

import io
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anmstrip.output.files import replaced
from anmstrip.output.summary import plain
from anmstrip.scene.errors import InputError, Mistake

_FACTS, _ARRAY = "facts", "array/"


def save(
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


def load(path: str | os.PathLike[str]) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
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
        raise _refused(path, "no such file") from error
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            found = {name: archive[name] for name in archive.files}
        facts = json.loads(found.pop(_FACTS).tobytes())
    except Exception as error:  # damage shows as exceptions of any kind
        raise _refused(path, f"damaged ({error})") from error
    return {name.removeprefix(_ARRAY): values for name, values in found.items()}, facts


def _refused(path: str | os.PathLike[str], found: str) -> InputError:
    mistake = Mistake(
        file=str(path),
        key="",
        value=found,
        expected="the checkpoint that an interrupted run left",
        hint="the same command without --resume, to start from the beginning",
    )
    return InputError((mistake,))
