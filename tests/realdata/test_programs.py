"""Programs that people wrote or generated: read, every byte kept, and as many motions understood as before."""

import pytest

from taskcal.robot.catalogue import load_robot
from tests.robot_programs.shares import programs, share_of

pytestmark = pytest.mark.realdata

MIN_SHARES = {"RAPID": 0.84, "KRL": 0.44, "APT": 0.99}
"""Shares of their motions that are understood; the rest is computed at run time, or needs files that are not there."""

SAMPLED_PROGRAMS = "rapid-toolpath-viewer", "BPF2PLTZPK2", "KONTUR"


def read(folder, chosen):
    """Motions and those understood, by language; every program keeps its bytes."""
    robot, totals = load_robot("abb-irb120"), {}
    for language, files in programs(folder / "programs"):
        if not chosen(str(files[0])):
            continue
        share = share_of(files, robot)
        assert share.kept, files
        motions, understood = totals.get(language, (0, 0))
        totals[language] = motions + share.motions, understood + share.understood
    return totals


def test_some_programs_are_read_and_keep_every_byte(data_folder):
    totals = read(data_folder, lambda path: any(name in path for name in SAMPLED_PROGRAMS))
    assert totals.keys() == MIN_SHARES.keys()
    assert all(understood > 0.25 * motions for motions, understood in totals.values())
    assert totals["APT"][1] > 0.95 * totals["APT"][0]


@pytest.mark.long
def test_of_all_programs_as_much_is_understood_as_before(data_folder):
    totals = read(data_folder, lambda path: True)
    shares = {language: understood / motions for language, (motions, understood) in totals.items()}
    assert all(shares[language] >= least for language, least in MIN_SHARES.items()), shares
