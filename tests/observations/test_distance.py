import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.errors import CampaignError, FileError, UnitError
from taskcal.geometry import se3
from taskcal.observations import Lengths, Measured
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from taskcal.registration.registration import register
from taskcal.virtual.cell import simulate
from tests.observations.files import ROBOT, written
from tests.reading.virtual_task import MODEL, postures

seeds = st.integers(0, 2**32 - 1)


def pulled(seed, rows=60, anchors=2, flat=False, turned=True):
    """Poses of a tool that carries a wire's end, and lengths to several anchors with an offset each."""
    rng = np.random.default_rng(seed)
    R, t = se3.exp(rng.uniform(-1.5, 1.5, (rows, 3))), rng.uniform(-0.2, 0.2, 3)
    p = rng.uniform(-1.0, 1.0, (rows, 3))
    if not turned:
        R, t = np.tile(np.eye(3), (rows, 1, 1)), np.zeros(3)
    if flat:
        p[:, 2] = 0.3
    a = rng.normal(size=(anchors, 3))
    a *= rng.uniform(1.5, 3.0, (anchors, 1)) / np.linalg.norm(a, axis=1)[:, None]
    c, of = rng.uniform(-0.1, 0.1, anchors), np.arange(rows) % anchors
    d = np.linalg.norm(p + R @ t - a[of], axis=1) + c[of]
    kind = Lengths(anchors=tuple("abc"[:anchors]), of=of)
    return (
        se3.pose(R, p),
        Measured(np.stack([d, 0 * d, 0 * d], axis=1)),
        kind,
        t,
        np.concatenate([a, c[:, None]], axis=1),
    )


@given(seeds)
@settings(max_examples=15)
def test_tip_anchors_and_offsets_are_found_without_a_guess(seed):
    tool, measured, kind, t, own = pulled(seed)
    placed = kind.place(tool, measured)
    np.testing.assert_allclose(placed.T_tool_target[:3, 3], t, atol=1e-6)
    np.testing.assert_allclose(placed.unknown.reshape(-1, 4), own, atol=1e-6)
    assert not placed.unobservable.any()


@given(seeds, st.sampled_from([(1e-3, "metres where millimetres are"), (1e3, "millimetres where metres are")]))
@settings(max_examples=8)
def test_lengths_in_another_unit_are_rejected_despite_outliers(seed, unit):
    """Lengths in another unit are rejected, whatever the value of a single row."""
    factor, said = unit
    tool, measured, kind, _, _ = pulled(seed)
    kind.place(tool, measured)
    measured.points[:, 0] *= factor
    measured.points[7, 0] /= factor
    with pytest.raises(UnitError, match=f"they seem to be in {said} stated; write them in millimetres under d_mm"):
        kind.place(tool, measured)


@given(seeds)
@settings(max_examples=5)
def test_wire_registration_is_robust_to_wrong_rows(seed):
    """Anchors and target are located with an inaccurate robot and some wrong rows."""
    rng = np.random.default_rng(seed)
    tool, measured, kind, t, own = pulled(seed, rows=90)
    tool[:, :3, 3] += 2e-3 * rng.normal(size=(90, 3))
    measured.points[::30, 0] += 0.2
    placed = kind.place(tool, measured)
    np.testing.assert_allclose(placed.T_tool_target[:3, 3], t, atol=0.01)
    np.testing.assert_allclose(placed.unknown.reshape(-1, 4), own, atol=0.03)
    assert set(np.flatnonzero(placed.distance > 0.1)) == {0, 30, 60}


def test_coplanar_positions_cannot_exclude_mirrored_anchor():
    """Positions in one plane do not distinguish an anchor from its mirror image."""
    tool, measured, kind, _, _ = pulled(4, flat=True, turned=False)
    with pytest.raises(CampaignError, match=r"anchor 'a' could be at .* or, mirrored, at .* in one plane"):
        kind.place(tool, measured)


def test_a_wrong_minimum_of_few_lengths_is_not_taken():
    """From most starts these lengths end at another minimum, with residuals of some 6 mm and an anchor metres away."""
    x = 0.5 * MODEL.tolerances * np.random.default_rng((12, 1)).normal(size=len(MODEL))
    rng = np.random.default_rng((12, 2))
    campaign, truth = simulate(MODEL, postures(80, 12), rng=rng, x=x, observe="wire+board")
    found = register(MODEL, campaign.take(slice(40)).of_targets(campaign.targets[:1]))
    true = [value for name, value in truth.unknowns.items() if name.startswith("anchor")]
    np.testing.assert_allclose(found.unknowns[0], true, atol=0.1)


def test_in_one_orientation_the_tip_stays_at_the_tool_point():
    tool, measured, kind, _, own = pulled(5, turned=False)
    placed = kind.place(tool, measured)
    np.testing.assert_allclose(placed.unobservable, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(placed.T_tool_target[:3, 3], 0.0, atol=1e-6)
    np.testing.assert_allclose(placed.unknown.reshape(-1, 4), own, atol=1e-5)


def test_few_lengths_are_refused():
    tool, measured, kind, _, _ = pulled(6, rows=20)
    with pytest.raises(CampaignError, match="10 lengths to anchor 'a' do not tell where it is; measure 12 or more"):
        kind.place(tool, measured)


def test_anchors_settle_where_the_tip_is_known():
    tool, measured, kind, t, own = pulled(7)
    target = tool @ se3.pose(np.eye(3), t)
    np.testing.assert_allclose(kind.settle(target, measured, np.full(8, np.nan)).reshape(-1, 4), own, atol=1e-7)
    scaled = Lengths(anchors=kind.anchors, of=kind.of, scaled=True)
    longer = Measured(measured.points * 1.01)
    known = np.concatenate([(own * [1, 1, 1, 1.01]).reshape(-1), [0.01]])
    np.testing.assert_allclose(scaled.settle(target, longer, known), known, atol=1e-7)
    assert kind.tells_scale
    assert not scaled.tells_scale


def test_some_rows_keep_only_the_anchors_that_they_name():
    kind = Lengths(anchors=("a", "b", "c"), of=np.array([0, 1, 2, -1, 2]))
    some = kind.take(np.array([4, 3, 0]))
    assert (some.anchors, some.of.tolist()) == (("c", "a"), [0, -1, 1])
    assert Lengths.of_description(kind.describe()).describe() == kind.describe()


def test_lengths_are_read_and_written(tmp_path):
    file = written(tmp_path, "d_mm,Anchor,u_mm", "812.5,left,0.1", ",,0.1", "700,right,0.1")
    campaign = read_campaign(file, ROBOT)
    (kind,) = campaign.observations
    assert (campaign.targets, kind.anchors, kind.of.tolist()) == (("wire",), ("left", "right"), [0, -1, 1])
    np.testing.assert_allclose(campaign.points[:, 0], [[0.8125, 0, 0], [np.nan] * 3, [0.7, 0, 0]])
    np.testing.assert_allclose(campaign.covariances()[[0, 2], 0, 0, 0], 1e-8)
    write_campaign(tmp_path / "again.csv", campaign, ROBOT)
    np.testing.assert_allclose(read_campaign(tmp_path / "again.csv", ROBOT).points, campaign.points)


@pytest.mark.parametrize(
    ("header", "row", "message"),
    [
        ("d_mm,anchor", "500,", "campaign.csv:2: column 'anchor': the cell is empty; name the anchor"),
        ("d_mm", "-3", "campaign.csv:2: column 'd_mm': -3 is not a length"),
        ("d", "500", "campaign.csv:1: column 'd': the unit is not stated; name the column d_mm"),
    ],
)
def test_a_wrong_cell_is_refused(tmp_path, header, row, message):
    with pytest.raises(FileError, match=re.escape(message)):
        read_campaign(written(tmp_path, header, row), ROBOT)
