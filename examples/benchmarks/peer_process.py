"""One program on the capstan, in a process of its own.

``python examples/benchmarks/peer_process.py NAME FACTOR`` prints the answer as one
line of JSON; for this program the factor may be ``mesh``: contact as sharp as the mesh resolves.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from importlib import import_module

from peer_capstan import Answer, ours
from strips import capstan, threaded

OURS = {
    "section": (capstan, "section", 2, 0.05),
    "threaded-section": (threaded, "section", 2, 0.05),
    "shell": (capstan, "shell", 10, 0.025),
    "threaded-shell": (threaded, "shell", 18, 0.025),
}
"""Name → scene, level of kinematics, elements across, their length over the roller (m)."""


def solved(name: str, stiffer: float | None) -> Answer:
    """By the program of that name, with contact so much stiffer, or left to the mesh."""
    if name in OURS:
        return ours(*OURS[name])(stiffer)
    found: Answer = import_module(f"peer_{name}").solved(stiffer)
    return found


def main() -> None:
    """Solve what the command line says."""
    factor = None if sys.argv[2] == "mesh" else float(sys.argv[2])
    print(json.dumps(asdict(solved(sys.argv[1], factor))))


if __name__ == "__main__":
    main()
