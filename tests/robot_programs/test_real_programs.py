"""Programs of KRL and APT that others wrote: every byte is kept, and the share of motions that is understood does not fall.

What is left of KRL: points in data lists that were not published (58 of the plotter), what programs compute from inputs, counters
and measurements, and motions that count from where those ended.
"""

from pathlib import Path

import pytest

from taskcal.robot.catalogue import load_robot
from tests.robot_programs.shares import programs, share_of

ROBOT = load_robot("abb-irb120")


def shares(folder: Path, language: str, repository: str) -> tuple[int, int]:
    """Motions that are understood, and all."""
    found = [
        share_of(files, ROBOT)
        for name, files in programs(folder / "programs")
        if name == language and repository in str(files[0])
    ]
    assert all(share.kept for share in found)
    return sum(share.understood for share in found), sum(share.motions for share in found)


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("repository", "least"),
    [
        ("KamWisa", 15),
        ("ros-industrial", 3),
        pytest.param("Naqiu06", 7, marks=pytest.mark.long),  # 41 files and KUKA's message library, some seconds
        pytest.param("HugoDanielson", 65, marks=pytest.mark.long),  # 152 files, some seconds
        pytest.param("ingeniado", 405, marks=pytest.mark.long),  # pallets of up to 200 bags, turn by turn
    ],
)
def test_krl_programs_of_others_are_understood(data_folder, repository, least):
    understood, motions = shares(data_folder, "KRL", repository)
    assert least <= understood <= motions


@pytest.mark.realdata
def test_apt_programs_of_others_are_understood(data_folder):
    understood, motions = shares(data_folder, "APT", "HumMan")
    assert understood >= 0.98 * motions
