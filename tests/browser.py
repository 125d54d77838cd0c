"""What a real browser, without a display or a network, makes of a page."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    *("--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"),
    *("--enable-unsafe-swiftshader", "--enable-logging=stderr", "--virtual-time-budget=20000"),
    *("--host-resolver-rules=MAP * ~NOTFOUND", "--window-size=1200,2400"),
    "--allow-file-access-from-files",
)
"""Without a display, drawing by the processor, without any network."""


def shown(address: str, scratch: Path) -> str:
    """Return the page as it is once its scripts have run, which must not complain of anything.

    A test is skipped on a machine without a browser.
    """
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip(f"no browser on this machine: none of {', '.join(BROWSERS)}")
    done = subprocess.run(
        [browser, *FLAGS, f"--user-data-dir={scratch}", "--dump-dom", address],
        capture_output=True,
        text=True,
        timeout=240,
        check=True,
        env={**os.environ, "HOME": str(scratch)},
    )
    words = [line for line in done.stderr.splitlines() if ":CONSOLE" in line]
    assert not [line for line in words if "willReadFrequently" not in line], words
    return done.stdout
