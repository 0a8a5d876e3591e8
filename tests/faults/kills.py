"""kill −9 at random moments of every command that writes: ``python -m tests.faults.kills 200 [COMMAND …] [--seed 0]``.

An experiment of hours, not a test; a sample of it is in the tests. Each command runs in a process group of its own, half of the
kills fall into the last tenth of its time, when it writes. What killed runs left stays for the next one. After each kill no file
that was there is changed, and every file that is new is whole; after some of them the command runs to its end and leaves nothing
beside.
"""

import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from argparse import ArgumentParser
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree

import pyarrow.parquet

from tests.cli.interruptions import COMMANDS, prepare

EVERY = 20
"""Kills after which the command runs to its end."""


def digests(folder: Path) -> dict[Path, str]:
    """Of all files, those that lie beside their places left out."""
    out: dict[Path, str] = {}
    for path in folder.rglob("*"):
        with suppress(FileNotFoundError, IsADirectoryError):
            if not path.name.endswith(".part"):
                out[path] = hashlib.sha256(path.read_bytes()).hexdigest()
    return out


def is_whole(path: Path) -> bool:
    """Whether a file that a command wrote ends as such files do."""
    try:
        match path.suffix:
            case ".json":
                json.loads(path.read_text())
            case ".toml":
                tomllib.loads(path.read_text())
            case ".urdf":
                ElementTree.parse(path)
            case ".parquet":
                pyarrow.parquet.read_table(path)
            case ".html":
                return path.read_text().rstrip().endswith("</html>")
            case _:
                return path.read_bytes().endswith(b"\n")
    except (ValueError, OSError, ElementTree.ParseError):
        return False
    return True


def start(folder: Path, line: str) -> subprocess.Popen[str]:
    """A command in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "taskcal", *line.split()],
        cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip


def kill(folder: Path, line: str, moment: float) -> bool:
    """Start a command and kill it, and all that it started, after some seconds; whether it was still running."""
    process = start(folder, line)
    try:
        process.communicate(timeout=moment)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return True
    return False


def to_the_end(folder: Path, line: str) -> list[str]:
    """Run a command whose earlier runs were killed; says what is wrong."""
    process = start(folder, line)
    _, said = process.communicate()
    left = [path.name for path in folder.rglob("*.part")]
    return [
        *([f"the next run ends with {process.returncode}: {said[-500:]}"] if process.returncode else []),
        *([f"the next run leaves {left}"] if left else []),
    ]


def faults(folder: Path, before: dict[Path, str], own: Iterable[Path]) -> list[str]:
    """What a killed command did to files that are not its own, and which of its own are not whole."""
    after, mine = digests(folder), set(own)
    lost = [path.name for path, digest in before.items() if path not in mine and after.get(path) != digest]
    half = [path.name for path in after if (path not in before or path in mine) and not is_whole(path)]
    return [*([f"changed {lost}"] if lost else []), *([f"not whole: {half}"] if half else [])]


def check(folder: Path, line: str, times: int, rng: random.Random) -> tuple[int, list[str]]:
    """Kill a command some times; how often it was still running, and what was wrong."""
    before = digests(folder)
    begin = time.monotonic()
    wrong = to_the_end(folder, line)
    whole, own = time.monotonic() - begin, set(digests(folder)) - set(before)
    _remove(own)
    killed = 0
    for number in range(1, times + 1):
        late = rng.random() < 0.5
        moment = whole * (rng.uniform(0.9, 1.0) if late else rng.uniform(0.0, 0.9))
        begin = time.monotonic()
        if kill(folder, line, moment):
            killed += 1
        else:  # it takes less than the first time, when all was new to the machine
            whole = min(whole, time.monotonic() - begin)
        wrong += [f"at {moment:.2f} of {whole:.2f} s: {fault}" for fault in faults(folder, before, own)]
        if number % EVERY == 0 or number == times:
            wrong += to_the_end(folder, line)
            _remove(own)
    return killed, wrong


def _remove(paths: Iterable[Path]) -> None:
    for path in paths:
        path.unlink(missing_ok=True)


def main() -> int:
    """Kill every command; says how many faults were found."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("times", type=int)
    parser.add_argument("commands", nargs="*", metavar="COMMAND")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    rng, found = random.Random(chosen.seed), 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["TASKCAL_STATE_DIR"] = tempfile.mkdtemp(prefix="taskcal-state-")
        prepare(folder)
        for command in chosen.commands or COMMANDS:
            if not {"-o", "--report", "--fix"} & set(COMMANDS[command].split()):
                continue
            killed, wrong = check(folder, COMMANDS[command], chosen.times, rng)
            found += len(wrong)
            for fault in wrong:
                print(f"    {command}: {fault}", flush=True)
            print(f"{command}: killed {killed} of {chosen.times} times before its end, {len(wrong)} faults", flush=True)
    return found


if __name__ == "__main__":
    sys.exit(min(main(), 1))
