"""Shuffled rows find their joints again by geometry, and points of another robot do not."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.diagnosis.diagnose import diagnose
from taskcal.diagnosis.hypotheses import Case
from taskcal.diagnosis.rows import pair_rows, rearranged
from taskcal.robot.catalogue import load_robot
from tests.diagnosis.virtual_campaigns import virtual


@pytest.mark.parametrize(("name", "targets"), [("staubli-rx160", 1), ("abb-irb1200-5-0.9", 3), ("denso-hsr065a1", 1)])
def test_shuffled_rows_are_paired_again(name, targets):
    sound = virtual(name, targets=targets, rows=30)
    order = np.random.default_rng(7).permutation(30)
    paired = pair_rows(Case.of(load_robot(name), rearranged(sound, order)))
    assert paired is not None
    np.testing.assert_array_equal(paired.mended.points, sound.points)
    np.testing.assert_array_equal(order[paired.source], np.arange(30))


def test_points_of_other_poses_are_not_paired():
    sound, other = virtual("ur5", 0, rows=30), virtual("ur5", 1, rows=30)
    assert pair_rows(Case.of(load_robot("ur5"), replace(sound, points=other.points))) is None


@pytest.mark.long
def test_shuffled_rows_in_metres_are_told_and_mended_together():
    robot, sound = load_robot("ur5"), virtual("ur5", rows=30)
    wrong = rearranged(sound, np.random.default_rng(7).permutation(30))
    found = diagnose(replace(wrong, points=wrong.points / 1e3), robot)
    assert {f.id for f in found.findings} == {"points-in-metres", "rows-shuffled"}
    assert found.unmended == ()
    np.testing.assert_allclose(found.campaign.points, sound.points)
