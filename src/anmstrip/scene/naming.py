"""Names for the tables of a list that have none."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def with_default_names(tables: Any, prefix: str) -> Any:
    """Return a list of tables where those without a name are called prefix + position.

    Anything that is no list of tables is returned as it is.

    Examples
    --------
    >>> with_default_names([{"radius": 1.0}, {"name": "big"}, {}], "r")
    [{'name': 'r1', 'radius': 1.0}, {'name': 'big'}, {'name': 'r3'}]
    """
    if not isinstance(tables, list | tuple):
        return tables
    return [
        {"name": f"{prefix}{position}", **table} if isinstance(table, Mapping) else table
        for position, table in enumerate(tables, start=1)
    ]
