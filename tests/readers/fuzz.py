"""Random damage to every kind of file that is read: `python -m tests.readers.fuzz campaign 100000 [FIRST_SEED]`.

Whatever the bytes of a small file are, reading it ends soon, in what it holds or in a TaskcalError. Without arguments, a sample of
every kind and of every language of programs, as `make fuzz` does.
"""

import sys
import tempfile
import time
import traceback
import warnings
from functools import cache
from pathlib import Path

import numpy as np

from taskcal.errors import TaskcalError
from tests.readers.damage import Files
from tests.readers.readers import READERS
from tests.robot_programs import fuzz as programs

LONGEST = 2.0
"""Seconds of computing that no small file may take."""

SAMPLE_OF_PROGRAMS = 100
"""Cases of each language in the sample."""


def check_case(kind: str, seed: int, folder: Path) -> str:
    """Damage one file and read it; says what became of it.

    Raises:
        AssertionError: it took too long.
    """
    rng = np.random.default_rng(seed)
    files = _sound(kind)
    name, content = files[int(rng.integers(len(files)))]
    content = READERS[kind].damage(rng, content, [other for _, other in files])
    path = folder / name
    path.write_bytes(content)
    begin = time.process_time()
    try:
        READERS[kind].read(path)
    except TaskcalError:
        return "refused"
    finally:
        took = time.process_time() - begin
        assert took < LONGEST, f"reading takes {took:.1f} s"
    return "read"


@cache
def _sound(kind: str) -> Files:
    return READERS[kind].files()


def fuzz(kind: str, count: int, first: int = 0) -> int:
    """Check many cases, print those that fail, and say how many did."""
    outcomes: dict[str, int] = {}
    begin, slowest = time.perf_counter(), 0.0
    # what warns has not been thought of
    warnings.simplefilter("error")
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            started = time.process_time()
            try:
                outcome = check_case(kind, seed, Path(folder))
            except Exception:
                outcome = "failed"
                print(f"{kind} seed {seed}:", traceback.format_exc(limit=-3), file=sys.stderr, flush=True)
            slowest = max(slowest, time.process_time() - started)
            outcomes[outcome] = outcomes.get(outcome, 0) + 1
    print(
        f"{kind}: {count} cases in {time.perf_counter() - begin:.0f} s, the slowest {slowest:.2f} s: {outcomes}",
        flush=True,
    )
    return outcomes.get("failed", 0)


def sample() -> int:
    """Check some cases of every kind, other ones than the tests do; says how many failed."""
    failed = sum(fuzz(kind, reader.sample, first=5000) for kind, reader in READERS.items())
    return failed + sum(programs.fuzz(name, SAMPLE_OF_PROGRAMS, first=5000) for name in programs.LANGUAGES)


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if not arguments:
        sys.exit(min(sample(), 1))
    if len(arguments) not in (2, 3) or arguments[0] not in READERS:
        sys.exit(f"usage: python -m tests.readers.fuzz [{'|'.join(READERS)} COUNT [FIRST_SEED]]")
    sys.exit(min(fuzz(arguments[0], *map(int, arguments[1:])), 1))
