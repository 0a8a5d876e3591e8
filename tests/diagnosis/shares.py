"""How often the doctor's first answer is right, and one of its first three: ``python -m tests.diagnosis.shares [FOLDER]``.

An experiment of many minutes, not a test. With the folder of the measured robots it puts every mistake that applies into sixty rows
of each of their campaigns, otherwise into campaigns of virtual robots. Exchanged joints that were hardly moved, or zeros that other
mistakes equal, leave no trace; they are counted as missed.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

from taskcal.diagnosis.diagnose import diagnose
from taskcal.measurement.campaign import Campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.robot import Robot
from tests.diagnosis.mistakes import every
from tests.diagnosis.test_diagnose import virtual
from tests.realdata.test_doctor import FOLDERS, sixty_rows

VIRTUAL = "ur5", "abb-irb120", "kuka-kr16-2", "staubli-rx160", "franka-panda"


def campaigns(folder: Path | None) -> Iterator[tuple[str, Robot, Campaign, int]]:
    """Name, robot, sound campaign and seed."""
    if folder is None:
        for seed, name in enumerate(VIRTUAL):
            yield name, load_robot(name), virtual(name, seed, targets=1 + 2 * (seed % 2)), seed
        return
    for name in FOLDERS:
        robot = load_robot(name)
        yield name, robot, sixty_rows(folder, name, robot), 0


def main(arguments: list[str]) -> None:
    """Print a line for each robot, and one for each answer that was not the first."""
    for name, robot, sound, seed in campaigns(Path(arguments[0]) if arguments else None):
        false = [finding.id for finding in diagnose(sound, robot).findings]
        right = told = total = 0
        for mistake in every(sound, robot, seed):
            ids = [finding.id for finding in diagnose(mistake.campaign, robot).findings]
            total, right, told = total + 1, right + (ids[:1] == [mistake.id]), told + (mistake.id in ids[:3])
            if ids[:1] != [mistake.id]:
                print(f"{name}: {mistake.id} told as {', '.join(ids[:3]) or 'nothing'}", flush=True)
        print(
            f"{name}: first {right}, among three {told} of {total}; sound: {', '.join(false) or 'nothing'}", flush=True
        )


if __name__ == "__main__":
    main(sys.argv[1:])
