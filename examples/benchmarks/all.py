"""All benchmarks into one directory, with a page that names them."""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

REPORTS = ("effects", "tolerance", "states", "errors", "cases", "friction", "contact", "order",
           "mesh", "solvers", "time", "newton", "peers", "stiff", "stability", "shells", "wrinkles",
           "roller_wrinkles", "constants")  # fmt: skip

SCRIPTS = {name: f"examples/benchmarks/{name}.py" for name in REPORTS} | {
    "time": "examples/benchmarks/time_steps.py",  # time.py would hide a standard module
    "stability": "tests/hard/stability.py",
}
"""Name of the report → script, from the top of the repository."""


def run_all(directory: Path, *, quick: bool = False) -> None:
    """Run every script in a process of its own, and write the page after each."""
    lines = ["# Studies", "    python examples/benchmarks/all.py"]
    for name, script in SCRIPTS.items():
        options = ["--quick"] if quick else []
        subprocess.run([sys.executable, ROOT / script, *options, "-o", str(directory)], check=True)
        title, command = (directory / f"{name}.md").read_text(encoding="utf-8").split("\n\n")[:2]
        lines.append(f"* [{title.removeprefix('# ')}]({name}.md): `{command.strip()}`")
        (directory / "README.md").write_text("\n\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarse: seconds, with less to learn")
    parser.add_argument("-o", type=Path, default=Path("results/studies"), metavar="DIR")
    given = parser.parse_args()
    run_all(given.o, quick=given.quick)
