"""How often the doctor's first answer is right, and one of its first three: ``python -m tests.diagnosis.shares [FOLDER]``.

An experiment of many minutes, not a test. With the folder of the measured robots it puts every mistake that applies into sixty rows
of each of their campaigns, otherwise into campaigns of virtual robots. ``--robots``, ``--ids`` choose some, ``--every`` takes each
k-th case, ``--pairs`` that many pairs of mistakes instead, ``--mend`` asks the doctor again about what it has mended.
"""

import itertools
import time
from argparse import ArgumentParser
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.diagnosis.diagnose import Diagnosis, diagnose
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.robot import Robot
from tests.diagnosis.mistakes import Mistake, every, pairs
from tests.diagnosis.virtual_campaigns import VIRTUAL, virtual
from tests.realdata.test_doctor import FOLDERS, sixty_rows


@dataclass(frozen=True)
class Answer:
    """What was told of one case."""

    name: str
    ids: tuple[str, ...]
    """Put in."""
    said: str
    diagnosis: Diagnosis
    right: bool
    among_three: bool
    subject_right: bool
    seconds: float
    again: str | None
    """What is found once it is mended."""


def campaigns(folder: Path | None, names: list[str]) -> Iterator[tuple[str, Robot, Campaign, Campaign | None, int]]:
    """Name, robot, sound campaign, all rows that were measured, seed."""
    if folder is None:
        for seed, (name, choices) in enumerate(VIRTUAL.items()):
            if not names or name in names:
                yield (
                    name,
                    load_robot(name),
                    virtual(name, seed, **choices),
                    virtual(name, seed, **{**choices, "rows": 400}),
                    seed,
                )
        return
    for name in FOLDERS:
        if not names or name in names:
            robot = load_robot(name)
            whole = read_campaign(folder / FOLDERS[name] / "measurements.csv", robot)
            yield name, robot, sixty_rows(folder, name, robot), whole, 0


def answered(name: str, mistakes: tuple[Mistake, ...], *, mend: bool) -> Answer:
    """The doctor's answer to a campaign with one or two mistakes, the last with all of them in it."""
    wrong = mistakes[-1]
    ids = tuple(m.id for m in mistakes)
    start = time.process_time()
    found = diagnose(wrong.campaign, wrong.robot)
    seconds = time.process_time() - start
    told = [finding.id for finding in found.findings[:3]]
    right = told[:1] != [] and told[0] in ids
    first = next((f for f in found.findings if f.id in ids), None)
    subject = next((m.subject for m in mistakes if first is not None and m.id == first.id), ())
    again = None
    if mend and right and not found.unmended:
        after = diagnose(found.campaign, found.robot).findings
        again = ", ".join(f.id for f in after)
    return Answer(
        name=name,
        ids=ids,
        said=" + ".join(f"{m.id} {m.said}" for m in mistakes),
        diagnosis=found,
        right=right,
        among_three=any(i in ids for i in told),
        subject_right=first is not None and (not subject or set(subject) == set(first.subject)),
        seconds=seconds,
        again=again,
    )


def show(answer: Answer) -> None:
    """A line for an answer that is not wholly right."""
    findings = answer.diagnosis.findings
    told = ", ".join(f"{f.id} {'/'.join(f.subject[:3])} {f.confidence:.2f}" for f in findings[:4]) or "nothing"
    errors = f" ({findings[0].error_before * 1e3:.2f} to {findings[0].error_after * 1e3:.2f} mm)" if findings else ""
    if not answer.right or not answer.subject_right:
        print(f"{answer.name}: {answer.said} told as {told}{errors}", flush=True)
    if answer.again and not (len(answer.ids) > 1 and answer.again in answer.ids):
        print(f"{answer.name}: {answer.said}, mended, told as {answer.again}", flush=True)


def summary(answers: list[Answer]) -> None:
    """Tables by id and robot, of times, and of confidence."""
    names = list(dict.fromkeys(a.name for a in answers))
    cells: dict[tuple[str, str], list[Answer]] = defaultdict(list)
    for a in answers:
        key = a.ids[0] if len(a.ids) == 1 else "pairs"
        for where in ((key, a.name), ("all", a.name), (key, "all"), ("all", "all")):
            cells[where].append(a)
    keys = [*dict.fromkeys(key for key, _ in cells if key != "all"), "all"]
    print(f"{'first/three/of':18}" + "".join(f"{name[:15]:>16}" for name in [*names, "all"]))
    for key in keys:
        row = [cells.get((key, name), []) for name in [*names, "all"]]
        shown = (f"{sum(a.right for a in c)}/{sum(a.among_three for a in c)}/{len(c)}" if c else "" for c in row)
        print(f"{key:18}" + "".join(f"{text:>16}" for text in shown))
    seconds = np.array([a.seconds for a in answers])
    print(f"CPU seconds: median {np.median(seconds):.1f}, largest {seconds.max():.1f}")
    show_confidence(answers)
    mended = [a for a in answers if a.again is not None]
    if mended:
        print(f"mended: {sum(not a.again for a in mended)} of {len(mended)} sound afterwards")


def show_confidence(answers: list[Answer]) -> None:
    """How many answers of some stated confidence were right."""
    first = [(a.diagnosis.findings[0].confidence, a.right and a.subject_right) for a in answers if a.diagnosis.findings]
    told = np.array(first)
    for low, high in itertools.pairwise((0.0, 0.4, 0.6, 0.8, 0.95, 1.0)):
        inside = told[(told[:, 0] >= low) & (told[:, 0] < high)]
        if len(inside):
            right, stated = inside[:, 1].mean(), inside[:, 0].mean()
            print(f"confidence {low:.2f} to {high:.2f}: {right:.2f} right of {len(inside)}, stated {stated:.2f}")


def main() -> None:
    """Print a line for each answer that is not right, then the tables."""
    parser = ArgumentParser()
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--robots", default="")
    parser.add_argument("--ids", default="")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--pairs", type=int, default=0)
    parser.add_argument("--mend", action="store_true")
    given = parser.parse_args()
    ids = [i for i in given.ids.split(",") if i]
    answers: list[Answer] = []
    for name, robot, sound, whole, seed in campaigns(given.folder, [n for n in given.robots.split(",") if n]):
        false = diagnose(sound, robot).findings
        print(f"{name}: sound, {', '.join(f.id for f in false) or 'nothing'} told", flush=True)
        if given.pairs:
            cases = list(pairs(sound, robot, seed, given.pairs))
        else:
            cases = [(m,) for m in every(sound, robot, seed, whole) if not ids or m.id in ids][:: given.every]
        for case in cases:
            answers.append(answered(name, case, mend=given.mend))
            show(answers[-1])
    summary(answers)


if __name__ == "__main__":
    main()
