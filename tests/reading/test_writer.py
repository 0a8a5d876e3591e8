import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.campaigns.campaign import Campaign
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from taskcal.robot.conditions import Conditions
from taskcal.robot.robot_file import robot_from

ROBOT = robot_from({"name": "arm", "joint": [{"name": "shoulder"}, {"name": "slide", "type": "prismatic"}]})


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
@pytest.mark.parametrize("kind", ["one target", "several", "poses"])
def test_a_written_campaign_reads_back_to_a_nanometre(tmp_path, kind, suffix):
    rng = np.random.default_rng(0)
    targets = ("smr1", "smr2") if kind == "several" else ("tool",)
    points = rng.normal(size=(6, len(targets), 3))
    points[3, 0] = np.nan
    rotations = Rotation.from_quat(rng.normal(size=(6, 4))).as_matrix() if kind == "poses" else None
    campaign = Campaign(
        ids=tuple(f"pose {i}" for i in range(6)),
        q=rng.normal(size=(6, 2)),
        targets=targets,
        points=points,
        rotations=rotations,
        uncertainty=rng.uniform(1e-5, 1e-4, (6, len(targets))),
        reference_points={"base1": rng.normal(size=(6, 3))},
        conditions=Conditions(
            temperature=rng.uniform(18, 25, 6),
            time=np.sort(rng.uniform(0.0, 9e3, 6)),
            approach=rng.choice([-1.0, 0.0, 1.0], (6, 2)),
            move=rng.normal(size=(6, 2)),
        ),
    )
    path = tmp_path / f"campaign.{suffix}"
    write_campaign(path, campaign, ROBOT)
    assert (path.read_bytes()[:4] == b"PAR1") == (suffix == "parquet")
    again = read_campaign(path, ROBOT)
    assert (again.ids, again.targets) == (campaign.ids, campaign.targets)
    np.testing.assert_allclose(again.q, campaign.q, atol=1e-9)
    np.testing.assert_allclose(again.points, campaign.points, atol=1e-9)
    np.testing.assert_allclose(again.uncertainty, campaign.uncertainty, atol=1e-9)
    np.testing.assert_allclose(again.reference_points["base1"], campaign.reference_points["base1"], atol=1e-9)
    np.testing.assert_allclose(again.temperature, campaign.temperature, atol=1e-3)
    np.testing.assert_allclose(again.time, campaign.time, atol=1e-3)
    np.testing.assert_array_equal(again.approach, campaign.approach)
    np.testing.assert_allclose(again.move, campaign.move, atol=1e-9)
    if rotations is not None:
        np.testing.assert_allclose(again.rotations[campaign.valid[:, 0]], rotations[campaign.valid[:, 0]], atol=1e-9)
