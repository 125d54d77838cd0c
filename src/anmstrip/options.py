"""Options and exit statuses that several commands share."""

from __future__ import annotations

from pathlib import Path

import click

STOPPED, WRONG = 1, 2
"""Exit statuses: stopped before the end, wrong input."""

directory = click.option(
    "-o",
    "--output",
    "directory",
    metavar="DIR",
    type=click.Path(path_type=Path, file_okay=False),
    help="Where the results go (default: a directory of its own in results/).",
)
settings = click.option(
    "--set",
    "settings",
    metavar="KEY=VALUE",
    multiple=True,
    help="Use another value than the one written; may be given several times.",
)
scene = click.argument("scene", metavar="SCENE.toml", type=click.Path(path_type=Path))
quiet = click.option(
    "--quiet", is_flag=True, help="Show no progress; the last two lines still come."
)
