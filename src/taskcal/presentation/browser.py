"""A browser without a window, which draws what pages show: Chromium or one of its kin, as it is installed."""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from taskcal.errors import TaskcalError

NAMES = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "msedge",
    "microsoft-edge",
    "brave-browser",
)
"""Programs that will do, the first that is found."""

VARIABLE = "TASKCAL_BROWSER"
"""Of the environment; names the program where it is called otherwise, or stands elsewhere."""

PATIENCE = 120.0
"""Seconds."""


def find_browser() -> str:
    """The program.

    Raises:
        TaskcalError: there is none.
    """
    named = os.environ.get(VARIABLE)
    for name in (named,) if named else NAMES:
        program = shutil.which(name)
        if program:
            return program
    missing = f"{VARIABLE} names {named}, which is not a program" if named else "none was found"
    raise TaskcalError(
        f"figures are drawn by a browser, and {missing}: install Chromium, Chrome or Edge, or let {VARIABLE} name it"
    )


def run_browser(page: Path, arguments: Sequence[str]) -> str:
    """Open a page without a window, and give back what the browser prints.

    Args:
        page: file.
        arguments: what to do with it, such as ``--dump-dom``.

    Raises:
        TaskcalError: there is no browser, or it fails.
    """
    program = find_browser()
    with tempfile.TemporaryDirectory(prefix="taskcal-browser-", ignore_cleanup_errors=True) as profile:
        command = [
            program,
            "--headless=new",
            "--disable-gpu",
            "--no-first-run",
            "--hide-scrollbars",
            f"--user-data-dir={profile}",
        ]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            command.append("--no-sandbox")  # Chromium refuses to run as root otherwise
        command += ["--virtual-time-budget=20000", *arguments, page.resolve().as_uri()]
        try:
            done = subprocess.run(command, capture_output=True, timeout=PATIENCE, check=False)
        except (OSError, subprocess.TimeoutExpired) as failure:
            raise TaskcalError(f"the browser {program} did not draw the figures: {failure}") from failure
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        raise TaskcalError(
            f"the browser {program} failed with status {done.returncode}{f': {said[-1]}' if said else ''}"
        )
    return done.stdout.decode(errors="replace")
