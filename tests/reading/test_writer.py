import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.campaigns.campaign import Campaign
from taskcal.reading.reader import read_campaign, read_measurements
from taskcal.reading.writer import readings_text, write_campaign
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


SOME = {"id": [f"P{k}" for k in range(5)]}
JOINTS = {"shoulder_deg": [1.0, -20.0, 30.5, 4.0, 5.0], "slide_mm": [10.0, 0.5, -30.0, 4.0, 5.0]}
POINTS = {
    "station": ["north", "south", "north", "south", "south"],
    **{f"{t}_{axis}_mm": [s + 100.0 * k**2 for k in range(5)] for s, t in enumerate("ab") for axis in "xyz"},
    **{f"{t}_u_mm": [0.01 * (s + k) for k in range(5)] for s, t in enumerate("ab", 1)},
}
TURNS = np.array([[0, 0, 0, 1], [1, 0, 0, 0], [0, 0.6, 0, 0.8], [0.5, 0.5, 0.5, 0.5], [0, 0, 0.28, 0.96]])
POSES = {
    **{f"{axis}_mm": POINTS[f"a_{axis}_mm"] for axis in "xyz"},
    **dict(zip(("qx", "qy", "qz", "qw"), TURNS.T, strict=True)),
}
SOCKETS = {"socket": ["one", "two", "one", "two", "one"]}


@pytest.mark.parametrize(
    "columns", [JOINTS, POINTS, POSES, {**JOINTS, **SOCKETS}], ids=["joints", "points", "poses", "sockets"]
)
def test_written_readings_read_back_as_they_were(tmp_path, columns):
    """Of joints alone or points alone, with their stations, uncertainties, rotations and what the robot touched."""
    columns = SOME | columns
    lines = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    first = read_measurements(tmp_path / "a.csv", ROBOT)
    (tmp_path / "b.csv").write_text(readings_text(first, ROBOT))
    again = read_measurements(tmp_path / "b.csv", ROBOT)
    assert (again.ids, again.stations) == (first.ids, first.stations)
    assert (first.stations is None) == ("station" not in columns)
    for one, other in zip((first.q, *parts_of(first)), (again.q, *parts_of(again)), strict=True):
        assert (one is None) == (other is None)
        if one is not None:
            np.testing.assert_allclose(other, one, atol=1e-9)
    assert (again.observed is None) == (first.observed is None)
    if first.observed is not None:
        assert again.observed.cells == first.observed.cells
    said = {name for name in columns if name.endswith("_u_mm")}
    assert {f"{name}_u_mm" for name in first.uncertainty} == said


def parts_of(readings):
    """Positions, uncertainties and rotations, by their targets."""
    groups = readings.points, readings.uncertainty, readings.rotations
    return [group[name] for group in groups for name in sorted(group)]
