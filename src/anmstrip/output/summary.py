"""The outcome of a run as JSON, for other programs."""

import json
import math
import os
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

import numpy as np

from anmstrip.output.files import replaced


def write(path: str | os.PathLike[str], summary: Mapping[str, Any]) -> None:
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
