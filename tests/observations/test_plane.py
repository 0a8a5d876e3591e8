import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.observations import Measured, Planes
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from tests.observations.files import ROBOT, written

seeds = st.integers(0, 2**32 - 1)


def touched(seed, rows=45, planes=3):
    """Poses of a probe whose tip touches planes, its tip on the tool, and the planes as normal and offset."""
    rng = np.random.default_rng(seed)
    t, of = rng.uniform(-0.15, 0.15, 3), np.arange(rows) % planes
    frames = se3.pose(se3.exp(rng.normal(size=(planes, 3))), rng.uniform(-0.8, 0.8, (planes, 3)))
    x = se3.apply(frames[of], np.concatenate([rng.uniform(-0.2, 0.2, (rows, 2)), np.zeros((rows, 1))], axis=1))
    R = se3.exp(rng.uniform(-1.0, 1.0, (rows, 3)))
    tool = se3.pose(R, x - R @ t)
    offsets = np.einsum("ki,ki->k", frames[:, :3, 2], frames[:, :3, 3])
    expected = np.concatenate([frames[:, :3, 2], offsets[:, None]], axis=1)
    kind = Planes(planes=tuple("abc"[:planes]), of=of)
    return tool, Measured(np.zeros((rows, 3))), kind, t, expected


def same_planes(found, expected):
    found = found.reshape(-1, 4)
    sign = np.sign((found[:, :3] * expected[:, :3]).sum(axis=1, keepdims=True))
    np.testing.assert_allclose(sign * found, expected, atol=1e-6)


@given(seeds)
@settings(max_examples=5)
def test_tip_and_planes_are_found_without_a_guess(seed):
    tool, measured, kind, t, expected = touched(seed)
    placed = kind.place(tool, measured)
    np.testing.assert_allclose(placed.T_tool_target[:3, 3], t, atol=1e-6)
    assert not placed.unobservable.any()
    same_planes(placed.unknown, expected)
    assert placed.distance.max() < 1e-7


def test_they_are_found_in_spite_of_a_wrong_touch():
    tool, measured, kind, t, _ = touched(5, rows=60)
    tool[9, :3, 3] += 0.05
    placed = kind.place(tool, measured)
    np.testing.assert_allclose(placed.T_tool_target[:3, 3], t, atol=1e-4)
    assert np.argmax(placed.distance) == 9


def test_one_orientation_does_not_tell_the_tip():
    tool, measured, kind, t, _ = touched(6)
    tips = tool[:, :3, 3] + tool[:, :3, :3] @ t
    placed = kind.place(se3.pose(np.broadcast_to(np.eye(3), (len(tips), 3, 3)), tips), measured)
    np.testing.assert_allclose(placed.unobservable, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(placed.T_tool_target, np.eye(4), atol=1e-9)


def test_planes_settle_where_the_tip_is_known():
    tool, measured, kind, t, expected = touched(7)
    target = tool @ se3.pose(np.eye(3), t)
    same_planes(kind.settle(target, measured, np.full(12, np.nan)), expected)
    few = kind.take(np.array([0, 1, 2, 3, 6, 9]))
    some = few.settle(target[[0, 1, 2, 3, 6, 9]], measured.take(np.arange(6)), np.ones(12)).reshape(-1, 4)
    assert np.isfinite(some[0]).all()
    assert np.isnan(some[1:]).all()
    with pytest.raises(
        CampaignError, match="fewer than three touches of plane 'b', which the calibration does not know"
    ):
        few.settle(target[[0, 1, 2, 3, 6, 9]], measured.take(np.arange(6)), np.full(12, np.nan))


def test_touches_along_a_line_and_few_touches_are_refused():
    tool, measured, kind, t, _ = touched(8, planes=1)
    x = tool[0, :3, 3] + tool[0, :3, :3] @ t + np.linspace(0, 0.3, len(tool))[:, None] * [1.0, 0.0, 0.0]
    line = se3.pose(tool[:, :3, :3], x - tool[:, :3, :3] @ t)
    with pytest.raises(CampaignError, match="plane 'a' was touched along a line only"):
        kind.place(line, measured)
    few = kind.take(np.arange(3))
    with pytest.raises(CampaignError, match="3 touches of plane 'a' do not tell where it is; touch it 4 times"):
        few.place(tool[:3], measured.take(np.arange(3)))


def test_touches_are_read_and_written(tmp_path):
    campaign = read_campaign(written(tmp_path, "plane", "table", "", "wall"), ROBOT)
    (kind,) = campaign.observations
    assert (campaign.targets, kind.planes, kind.of.tolist()) == (("tip",), ("table", "wall"), [0, -1, 1])
    write_campaign(tmp_path / "again.csv", campaign, ROBOT)
    again = read_campaign(tmp_path / "again.csv", ROBOT)
    assert again.observations[0].describe() == kind.describe()
    assert re.match(r"Campaign\(again.csv: 3 planes of tip", repr(again))
