"""Make small mistakes in the core, see whether a test notices: `python -m tests.mutants PYTHON COUNT [SEED]`, or `make mutants`.

PYTHON runs the tests: what makes the mistakes lives in an environment of its own. A mistake is drawn from all that the modules
have, made in a copy of the repository, and tests that run its line are run until one fails. What was found stays in
`build/mutants/found.jsonl`: what is there already is not tried again. At the end, the tests that failed are run without a mistake:
one that fails then, too, has noticed nothing, and its mistakes are tried again without it.
"""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from tests.mutants.covering_tests import read_covering_tests
from tests.mutants.mutations import Mutation, mutations

ROOT = Path(__file__).resolve().parents[2]
PLACE = ROOT / "build" / "mutants"
FOUND = PLACE / "found.jsonl"
CORE = ("kernels/*.py", "geometry/*.py", "analysis/*.py", "estimation/*.py", "identification/*.py")
WORKERS = 2
LONGEST = 90.0
"""Seconds that the tests of one mistake take together, without the mistake; four times that at a second look."""
MAX_SECONDS = 420.0
"""Seconds after which a mistake has stopped the tests from ending, which is noticing it, too."""


@dataclass(frozen=True)
class Trial:
    """What became of one mistake; `noticed_by` is the test, or what else showed it."""

    mutation: Mutation
    tests: int
    noticed_by: str

    def line(self) -> str:
        content = asdict(self.mutation) | {"path": str(self.mutation.path)}
        return json.dumps(content | {"tests": self.tests, "noticed_by": self.noticed_by})


def trial_of(line: str) -> Trial:
    """A line of the file of what was found."""
    content: dict[str, Any] = json.loads(line)
    tests, noticed_by = content.pop("tests"), content.pop("noticed_by")
    return Trial(Mutation(**content | {"path": Path(content["path"])}), tests, noticed_by)


def draw(count: int, seed: int) -> list[Mutation]:
    """Mistakes from all modules of the core, each as likely as any other."""
    package = ROOT / "src" / "taskcal"
    paths = sorted(
        path.relative_to(ROOT) for pattern in CORE for path in package.glob(pattern) if path.stem != "__init__"
    )
    every = [mutation for path in paths for mutation in mutations(ROOT, path)]
    print(f"{len(every)} mistakes could be made in {len(paths)} modules", flush=True)
    return random.Random(seed).sample(every, min(count, len(every)))


def copy_repository(folder: Path) -> Path:
    """A copy of what is under version control, to make mistakes in."""
    shutil.rmtree(folder, ignore_errors=True)
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, files.split("\0")):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)
    return folder


def run_to_the_end(
    command: Sequence[str], folder: Path, environment: Mapping[str, str], patience: float | None
) -> tuple[int, str] | None:
    """Exit status and output of a command; none where it does not end, and it and all that it started are stopped."""
    with subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            output, _ = process.communicate(timeout=patience)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return None
        return process.returncode, output


def failing(python: str, folder: Path, tests: Sequence[str], *, first_only: bool = True) -> list[str]:
    """Those of some tests that fail in a copy of the repository; where only the first matters, the tests have an end."""
    if not tests:
        return []
    chosen = folder / "chosen-tests.txt"
    chosen.write_text("\n".join(tests), encoding="utf-8")
    command = [python, "-m", "pytest", "-rfE", "--tb=no", "-p", "no:cacheprovider", "-p", "no:xdist"]
    command += ["-m", "", *(["-x"] if first_only else []), f"@{chosen}"]
    # bytecode of a moment ago would be taken for that of a file that was changed since
    own = {"PYTHONPATH": f"{folder / 'src'}{os.pathsep}{folder}", "PYTHONDONTWRITEBYTECODE": "1"}
    own |= {"NUMBA_CACHE_DIR": str(folder / "kernels")}
    ended = run_to_the_end(command, folder, os.environ | own, MAX_SECONDS if first_only else None)
    if ended is None:
        return ["no end"]
    status, output = ended
    if status == 0:
        return []
    marks = ("FAILED ", "ERROR ")
    failed = [line.split(" - ")[0].split(" ", 1)[1] for line in output.splitlines() if line.startswith(marks)]
    return failed or [f"pytest's exit status {status}"]


def try_mutation(python: str, mutation: Mutation, folder: Path, tests: Sequence[str]) -> Trial:
    """Make a mistake in a copy, run the tests of its line, and take it back."""
    place = folder / mutation.path
    sound = place.read_text(encoding="utf-8")
    kernels = set(folder.glob("kernels/*"))
    try:
        place.write_text(mutation.mutated(folder), encoding="utf-8")
        failed = failing(python, folder, tests)
    finally:
        place.write_text(sound, encoding="utf-8")
        if kernels:  # those of the first run are those of sound sources, or are compiled once more
            for mutated in set(folder.glob("kernels/*")) - kernels:
                shutil.rmtree(mutated)
    return Trial(mutation, len(tests), failed[0] if failed else "")


def try_all(
    python: str, drawn: Sequence[Mutation], *, longest: float = LONGEST, useless: frozenset[str] = frozenset()
) -> None:
    """Try mistakes in several copies at once; each result is kept as it comes."""
    covering = read_covering_tests(ROOT)
    copies: SimpleQueue[Path] = SimpleQueue()
    for number in range(WORKERS):
        copies.put(copy_repository(PLACE / f"copy-{number}"))

    def one(mutation: Mutation) -> Trial:
        tests = [test for test in covering.of(mutation.path, mutation.line, longest=longest) if test not in useless]
        folder = copies.get()
        try:
            return try_mutation(python, mutation, folder, tests)
        finally:
            copies.put(folder)

    with ThreadPoolExecutor(WORKERS) as pool, FOUND.open("a", encoding="utf-8") as file:
        for number, trial in enumerate(pool.map(one, drawn), 1):
            print(trial.line(), file=file, flush=True)
            what = trial.noticed_by or "NOT NOTICED"
            print(
                f"{number}/{len(drawn)} {trial.mutation.path}:{trial.mutation.line} {trial.mutation.operator}: {what}",
                flush=True,
            )


def found() -> dict[Mutation, Trial]:
    """Every trial so far; of a mistake that was tried again, the last."""
    lines = FOUND.read_text(encoding="utf-8").splitlines() if FOUND.exists() else []
    return {trial.mutation: trial for trial in map(trial_of, lines)}


def without_useless(python: str, drawn: Sequence[Mutation]) -> None:
    """Try those again that were noticed by a test which fails without a mistake, too."""
    tried = found()
    named = sorted(
        {tried[mutation].noticed_by for mutation in drawn if tried[mutation].noticed_by.startswith("tests/")}
    )
    useless = frozenset(failing(python, copy_repository(PLACE / "copy-0"), named, first_only=False))
    if useless:
        print("these fail without a mistake:", *sorted(useless), sep="\n  ", flush=True)
        try_all(python, [mutation for mutation in drawn if tried[mutation].noticed_by in useless], useless=useless)


def summary(drawn: Sequence[Mutation]) -> str:
    """Shares by folder, and what was not noticed."""
    tried = found()
    trials = [tried[mutation] for mutation in drawn]
    every = Counter(trial.mutation.path.parts[2] for trial in trials)
    noticed = Counter(trial.mutation.path.parts[2] for trial in trials if trial.noticed_by)
    lines = [f"{folder:16}{noticed[folder]:5} of {every[folder]:4}" for folder in sorted(every)]
    total = f"{noticed.total()} of {every.total()} noticed, {100 * noticed.total() / max(every.total(), 1):.0f} %"
    left = [f"{t.mutation.path}:{t.mutation.line} {t.mutation.operator}" for t in trials if not t.noticed_by]
    return "\n".join([*lines, total, *(["not noticed:", *sorted(left)] if left else [])])


def main(python: str, count: int, seed: int) -> None:
    """Draw, try what was not tried yet, and print the shares."""
    drawn = draw(count, seed)
    PLACE.mkdir(parents=True, exist_ok=True)
    tried = found()
    try_all(python, [mutation for mutation in drawn if mutation not in tried])
    without_useless(python, drawn)
    tried = found()
    try_all(python, [mutation for mutation in drawn if not tried[mutation].noticed_by], longest=4 * LONGEST)
    print(summary(drawn))


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if not 2 <= len(arguments) <= 3 or not all(argument.isdigit() for argument in arguments[1:]):
        sys.exit("usage: python -m tests.mutants PYTHON COUNT [SEED]")
    main(arguments[0], int(arguments[1]), int(arguments[2]) if len(arguments) == 3 else 0)
