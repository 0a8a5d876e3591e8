"""How far a command is, a line of JSON for each step on standard error, for a program that started it and asks for them."""

import json
import os
import sys
from contextlib import suppress

VARIABLE = "TASKCAL_PROGRESS"
"""Environment variable; ``lines`` asks for them."""


def report_step(step: str, done: int, of: int | None) -> None:
    """Say that a step begins, where that is asked for.

    Args:
        step: what is being done.
        done: steps before it.
        of: how many there are; None where that is not known.
    """
    if os.environ.get(VARIABLE) != "lines":
        return
    with suppress(OSError):
        print(json.dumps({"step": step, "done": done, "of": of}), file=sys.stderr, flush=True)
