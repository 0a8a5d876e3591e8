"""Make small mistakes, see whether a test notices: `python -m tests.mutants PYTHON COUNT [SEED [PACKAGE …]]`, or `make mutants`.

PYTHON runs the tests: what makes the mistakes lives in an environment of its own. Every package has as many of the mistakes as it
has of the lines. Each is made in a copy of the repository, and tests that need its module are run until one fails: first those of
the package's own folder, then the nearest of others. What was found stays in `build/mutants/found.jsonl`: what was noticed is not
tried again, what was not is tried again for longer behind all that was not tried yet, as there may be a test of it now. At the end,
the tests that failed are run without a mistake: one that fails then, too, has noticed nothing, and its mistakes are tried without.
"""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from tests.mutants.budget import TIME_IS_UP
from tests.mutants.mutations import Mutation, is_python, mutations
from tests.mutants.nearest_tests import nearest_tests, package_of, shares
from tests.touched import imports_of_files

ROOT = Path(__file__).resolve().parents[2]
PLACE = ROOT / "build" / "mutants"
FOUND = PLACE / "found.jsonl"
ENDED = (0, 5)
"""Exit statuses of pytest without a failure: all passed, none was there to run."""
WORKERS = int(os.environ.get("MUTANT_WORKERS", "2"))
LONGEST_S = 60.0
"""Processor time that the tests of one folder, or of the others, take for one mistake: a test begins before, or not at all. Four
times that at a second look."""
MAX_SECONDS = 420.0
"""Seconds after which a mistake has stopped the tests from ending, which is noticing it, too."""
MAX_DRAWS = 100
"""Draws for each mistake of a package, at most, of which some draw the same again."""


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


def draw(count: int, seed: int, packages: Sequence[str] = ()) -> list[Mutation]:
    """Mistakes of all packages, or some, in proportion to their lines; a larger count adds to those of a smaller one.

    Raises:
        LookupError: a package that there is not.
    """
    modules: dict[str, dict[Path, int]] = defaultdict(dict)
    for path in sorted((ROOT / "src").rglob("*.py")):
        if path.stem != "__init__":
            module = path.relative_to(ROOT)
            modules[package_of(module)][module] = path.read_text(encoding="utf-8").count("\n")
    if unknown := set(packages).difference(modules):
        raise LookupError(f"no package {', '.join(sorted(unknown))}; there are {', '.join(modules)}")
    lines = {name: sum(of.values()) for name, of in modules.items() if not packages or name in packages}
    drawn: list[tuple[float, Mutation]] = []
    for name, share in shares(count, lines).items():
        chosen = _draw_of_package(modules[name], share, random.Random(f"{seed} {name}"))
        drawn += [((k + 0.5) / share, mutation) for k, mutation in enumerate(chosen)]
    return [mutation for _, mutation in sorted(drawn, key=lambda one: one[0])]


def _draw_of_package(lines: Mapping[Path, int], count: int, rng: random.Random) -> list[Mutation]:
    """Each time a module by its lines, a line of it, a mistake in that; modules that are not drawn are not parsed."""
    possible: dict[Path, dict[int, list[Mutation]]] = {}
    drawn: dict[Mutation, None] = {}
    for _ in range(MAX_DRAWS * count):  # a package may have fewer mistakes
        if len(drawn) == count:
            break
        path = rng.choices(list(lines), list(lines.values()))[0]
        if path not in possible:
            possible[path] = defaultdict(list)
            for mutation in mutations(ROOT, path):
                possible[path][mutation.line].append(mutation)
        if possible[path]:
            one = rng.choice(possible[path][rng.choice(sorted(possible[path]))])
            if one in drawn or is_python(one.mutated(ROOT)):
                drawn[one] = None
    return list(drawn)


def copy_repository(folder: Path) -> Path:
    """A copy of what is under version control, to make mistakes in; kernels compiled in it before stay."""
    for part in folder.iterdir() if folder.is_dir() else ():
        if part.is_dir() and part.name != "kernels":
            shutil.rmtree(part)
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


def failing(
    python: str,
    folder: Path,
    tests: Sequence[str],
    *,
    first_only: bool = True,
    leave_out: Sequence[str] = (),
    longest: float = LONGEST_S,
) -> list[str]:
    """Those of some tests that fail in a copy of the repository; where only the first matters, the tests have an end."""
    if not tests:
        return []
    command = [python, "-m", "pytest", "-rfE", "--tb=no", "-p", "no:cacheprovider", "-p", "no:xdist"]
    command += ["-p", "tests.mutants.budget", *(f"--deselect={test}" for test in leave_out)]
    command += [*(["-x"] if first_only else []), *tests]
    # bytecode of a moment ago would be taken for that of a file that was changed since
    own = {"PYTHONPATH": f"{folder / 'src'}{os.pathsep}{folder}", "PYTHONDONTWRITEBYTECODE": "1"}
    own |= {"NUMBA_CACHE_DIR": str(folder / "kernels"), "MUTANT_SECONDS": str(longest if first_only else 1e9)}
    ended = run_to_the_end(command, folder, os.environ | own, MAX_SECONDS if first_only else None)
    if ended is None:
        return ["no end"]
    status, output = ended
    marks = ("FAILED ", "ERROR ")
    failed = [line.split(" - ")[0].split(" ", 1)[1] for line in output.splitlines() if line.startswith(marks)]
    if failed or status in ENDED or TIME_IS_UP in output:
        return failed
    return [f"pytest's exit status {status}"]


def try_mutation(
    python: str,
    mutation: Mutation,
    folder: Path,
    tests: Sequence[Sequence[str]],
    useless: Sequence[str] = (),
    longest: float = LONGEST_S,
) -> Trial:
    """Make a mistake in a copy, run tests part by part until one fails, and take it back."""
    place = folder / mutation.path
    sound = place.read_text(encoding="utf-8")
    kernels = set(folder.glob("kernels/*"))
    failed: list[str] = []
    try:
        place.write_text(mutation.mutated(folder), encoding="utf-8")
        for part in tests:
            failed = failed or failing(python, folder, part, leave_out=useless, longest=longest)
    finally:
        place.write_text(sound, encoding="utf-8")
        if kernels:  # those of the first run are those of sound sources, or are compiled once more
            for mutated in set(folder.glob("kernels/*")) - kernels:
                shutil.rmtree(mutated)
    return Trial(mutation, sum(map(len, tests)), failed[0] if failed else "")


def try_all(python: str, drawn: Sequence[Mutation], *, useless: Sequence[str] = (), longest: float = LONGEST_S) -> None:
    """Try mistakes in several copies at once; each result is kept as it comes."""
    imports = imports_of_files()
    copies: SimpleQueue[Path] = SimpleQueue()
    for number in range(WORKERS if drawn else 0):
        copies.put(copy_repository(PLACE / f"copy-{number}"))

    def one(mutation: Mutation) -> Trial:
        folder = copies.get()
        try:
            tests = [
                [file for file in part if (folder / file).is_file()] for part in nearest_tests(mutation.path, imports)
            ]
            return try_mutation(python, mutation, folder, tests, useless, longest)
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
    useless = failing(python, copy_repository(PLACE / "copy-0"), named, first_only=False)
    if useless:
        print("these fail without a mistake:", *useless, sep="\n  ", flush=True)
        try_all(python, [mutation for mutation in drawn if tried[mutation].noticed_by in useless], useless=useless)


def summary(drawn: Sequence[Mutation]) -> str:
    """Shares by package with their 95 % interval, and what was not noticed."""
    tried = found()
    trials = [tried[mutation] for mutation in drawn]
    every = Counter(package_of(trial.mutation.path) for trial in trials)
    noticed = Counter(package_of(trial.mutation.path) for trial in trials if trial.noticed_by)
    lines = [_share(name, noticed[name], every[name]) for name in sorted(every)]
    left = [f"{t.mutation.path}:{t.mutation.line} {t.mutation.operator}" for t in trials if not t.noticed_by]
    total = _share("all", noticed.total(), every.total())
    return "\n".join([*lines, total, *(["not noticed:", *sorted(left)] if left else [])])


def _share(name: str, noticed: int, tried: int) -> str:
    low, high = wilson(noticed, tried)
    return f"{name:24}{noticed:5} of {tried:4} noticed, {noticed / max(tried, 1):4.0%} ({low:.0%} to {high:.0%})"


def wilson(noticed: int, tried: int, z: float = 1.96) -> tuple[float, float]:
    """The interval of a share, of 95 % as a rule: Wilson (1927), eq. for a binomial count."""
    if not tried:
        return 0.0, 1.0
    share, more = noticed / tried, z**2 / tried
    half = z * (share * (1.0 - share) / tried + more / (4.0 * tried)) ** 0.5
    return (share + more / 2.0 - half) / (1.0 + more), (share + more / 2.0 + half) / (1.0 + more)


def main(python: str, count: int, seed: int, packages: Sequence[str] = ()) -> None:
    """Draw, try what was not tried yet and what was not noticed before, and print the shares."""
    drawn = draw(count, seed, packages)
    PLACE.mkdir(parents=True, exist_ok=True)
    if failing(python, copy_repository(PLACE / "copy-0"), ["tests/mutants/test_mutants.py"]):
        sys.exit(f"tests do not run in a copy of the repository: {PLACE / 'copy-0'}")
    tried = found()
    try_all(python, [mutation for mutation in drawn if mutation not in tried])
    tried = found()
    try_all(python, [mutation for mutation in drawn if not tried[mutation].noticed_by], longest=4.0 * LONGEST_S)
    without_useless(python, drawn)
    print(summary(drawn))


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if len(arguments) < 2 or not all(argument.isdigit() for argument in arguments[1:3]):
        sys.exit("usage: python -m tests.mutants PYTHON COUNT [SEED [PACKAGE …]]")
    main(arguments[0], int(arguments[1]), int(arguments[2]) if len(arguments) > 2 else 0, arguments[3:])
