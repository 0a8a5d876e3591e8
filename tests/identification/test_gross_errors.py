"""Wrong rows are named or the campaign is refused; sound ones name none; predictions stay those of the sound rows."""

import re
from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import CampaignError, FitError, TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import load_calibration
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate
from taskcal_demo.procedure import reference_task

REFLECTORS = {"a": np.array([0.05, 0.0, 0.06]), "b": np.array([-0.06, 0.05, 0.0]), "c": np.array([0.0, -0.07, 0.03])}
KINDS = {
    "one orientation": (0.0, {}),
    "±20°": (20.0, {}),
    "6-D": (20.0, {"pose": True}),
    "three reflectors": (20.0, {"targets": REFLECTORS}),
}
ERRORS = ("wrong joint", "swapped rows", "wrong point")


@pytest.fixture(scope="module")
def model():
    return ErrorModel(load_robot("abb-irb6660-205-1.9"))


@pytest.fixture(scope="module")
def poses(model):
    """Measured and other joint positions, by the spread of the tool's orientation."""
    return {
        spread: tuple(reach_task(model, reference_task(np.radians(spread)), n, seed=s).q for n, s in ((60, 1), (60, 2)))
        for spread in (0.0, 20.0)
    }


def spoil(campaign, error, count, rng):
    """The campaign with some wrong rows, and which."""
    rows = rng.choice(60, count + (count % 2 if error == "swapped rows" else 0), replace=False)
    if error == "swapped rows":
        order = np.arange(60)
        order[rows] = rows.reshape(-1, 2)[:, ::-1].ravel()
        rotations = None if campaign.rotations is None else campaign.rotations[order]
        return replace(campaign, points=campaign.points[order], rotations=rotations), set(rows.tolist())
    if error == "wrong point":
        points = campaign.points.copy()
        for row in rows:
            way = rng.normal(size=3)
            points[row, 0] += way / np.linalg.norm(way) * 10.0 ** rng.uniform(-2.3, 0.0)  # 5 mm to a metre
        return replace(campaign, points=points), set(rows.tolist())
    q = campaign.q.copy()
    for row in rows:
        joint = rng.choice([0, 3, 4, 5])  # the loop closes with any of them
        q[row, joint] += np.radians(rng.uniform(10.0, 60.0) * rng.choice([-1.0, 1.0]))
    return replace(campaign, q=q), set(rows.tolist())


def error_elsewhere(calibration, truth, q):
    predicted = calibration.predict(q)
    predicted = predicted[:, None, :3, 3] if calibration.layout.pose else predicted
    return np.linalg.norm(predicted - truth.points(q), axis=-1).mean()


def try_one(model, poses, kind, error, count, seed):
    """Whether the wrong rows were named or refused, whether an innocent one was named, and the ratio of the errors."""
    spread, options = KINDS[kind]
    measured, elsewhere = poses[spread]
    rng = np.random.default_rng(seed)
    campaign, truth = simulate(model, measured, rng=rng, **options)
    spoilt, rows = spoil(campaign, error, count, rng)
    try:
        found = identify(model, spoilt)
    except TaskcalError:
        return True, False, 1.0
    named = {row.row for row in found.left_out} | {outlier.row for outlier in found.outliers}
    clean = error_elsewhere(identify(model, campaign), truth, elsewhere)
    return rows <= named, bool(named - rows), error_elsewhere(found, truth, elsewhere) / clean


@pytest.mark.parametrize(("kind", "error", "count"), [
    ("one orientation", "wrong joint", 1),
    ("one orientation", "swapped rows", 6),
    ("±20°", "wrong point", 6),
    ("6-D", "wrong joint", 3),
    ("three reflectors", "wrong point", 3),
])  # fmt: skip
def test_wrong_rows_are_named_and_do_no_harm(model, poses, kind, error, count):
    results = [try_one(model, poses, kind, error, count, seed) for seed in range(2)]
    assert all(named for named, _, _ in results)
    assert np.median([ratio for _, _, ratio in results]) < 1.2


@pytest.mark.long
def test_over_two_hundred_campaigns(model, poses):
    cases = [(kind, error, count) for kind in KINDS for error in ERRORS for count in (1, 3, 6)]
    results = [try_one(model, poses, *cases[i % len(cases)], seed=i) for i in range(216)]
    assert np.mean([named for named, _, _ in results]) >= 0.95
    assert np.mean([ratio < 1.2 for _, _, ratio in results]) >= 0.9
    assert np.median([ratio for _, _, ratio in results]) < 1.05
    innocent = []
    for i in range(200):
        spread, options = list(KINDS.values())[i % 4]
        found = identify(model, simulate(model, poses[spread][0], rng=np.random.default_rng(1000 + i), **options)[0])
        innocent.append(bool(found.left_out or found.outliers))
    assert np.mean(innocent) <= 0.05


def test_gross_error_search_keeps_fit_of_sound_campaign(model, poses):
    """A campaign without gross errors is fitted as if no search had taken place."""
    campaign, _ = simulate(model, poses[20.0][0], rng=np.random.default_rng(3))
    looked, kept = identify(model, campaign), identify(model, campaign, gross_errors="keep")
    assert looked.left_out == ()
    np.testing.assert_array_equal(looked.z, kept.z)
    np.testing.assert_array_equal(looked.z_covariance, kept.z_covariance)


def test_what_was_left_out_is_said_and_saved(model, poses, tmp_path):
    campaign, _ = simulate(model, poses[20.0][0], rng=np.random.default_rng(3))
    points = campaign.points.copy()
    points[11] += 0.1
    found = identify(model, replace(campaign, points=points).take(np.arange(5, 60)))
    (row,) = found.left_out
    assert (row.row, row.id) == (11, campaign.ids[11])
    assert row.distance == pytest.approx(0.1 * np.sqrt(3.0), rel=0.01)
    assert re.match(
        r"1 of 55 rows cannot be right beside all others and were left out: row 11 .*173\.\d mm off", found.remarks[0]
    )
    found.save(tmp_path / "cal.json")
    assert load_calibration(tmp_path / "cal.json").left_out == found.left_out


@pytest.mark.parametrize("seed", range(3))
def test_a_row_whose_rotation_alone_is_wrong_is_said_to_be_turned(model, poses, seed):
    """By the angle between what was written and what was measured; a row whose point is wrong as well is said as before."""
    rng, rows = np.random.default_rng(seed), [7, 23]
    sound, _ = simulate(model, poses[20.0][0], rng=rng, pose=True)
    rotations, points = sound.rotations.copy(), sound.points.copy()
    rotations[rows], points[40] = np.eye(3), points[40] + 0.1
    said = identify(model, replace(sound, rotations=rotations, points=points)).remarks[0]
    angles = [np.degrees(np.linalg.norm(se3.log(R))) for R in sound.rotations[rows]]
    told = re.findall(r"row (\d+) \(id \d+\), ([\d.]+) mm(?: and its rotation (\d+)°)? off", said)
    assert [(int(row), float(turn or 0)) for row, _, turn in told] == [
        *((row, pytest.approx(angle, abs=1.0)) for row, angle in zip(rows, angles, strict=True)), (40, 0.0),
    ]  # fmt: skip
    assert [float(off) > 100.0 for _, off, _ in told] == [False, False, True]


@pytest.mark.parametrize("way", ["tracker", "socket", "camera", pytest.param("board", marks=pytest.mark.long)])
def test_identify_leaves_out_gross_rows_of_every_kind(way):
    """5 mm in three rows: little beside the nominal robot's own errors, and fifty times those of the calibrated one."""
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(0)
    sound, _ = simulate(model, rng.uniform(-1.2, 1.2, (60, 6)), rng=rng, observe=way, model_error=1e-4)
    q = sound.q.copy()
    q[[7, 20, 41], 1] += 5e-3 / np.linalg.norm(model.poses(q[[7, 20, 41]])[:, :3, 3], axis=1)
    found, right = identify(model, replace(sound, q=q)), identify(model, sound)
    assert right.left_out == ()
    assert [row.row for row in found.left_out] == [7, 20, 41]
    assert found.remarks[0].startswith("3 of 60 rows cannot be right beside all others and were left out: row 7 ")
    assert found.model_error[0] < 1.2 * right.model_error[0]
    if way == "tracker":
        assert identify(model, replace(sound, q=q), gross_errors="keep").left_out == ()


def test_more_wrong_rows_than_can_be_told_are_refused(model, poses):
    campaign, _ = simulate(model, poses[20.0][0], rng=np.random.default_rng(3))
    points = campaign.points.copy()
    points[::6] += np.random.default_rng(4).normal(size=(10, 1, 3)) * 0.05
    with pytest.raises(CampaignError, match=r"10 of 60 rows do not agree with the others \(row 0 .*more than a tenth"):
        identify(model, replace(campaign, points=points))


def test_identify_rejects_distant_target_unless_allowed(model, poses):
    """A target too far from the TCP is rejected unless its distance is allowed."""
    far = {"far": np.array([0.0, 1.2, 0.4])}
    campaign, _ = simulate(model, poses[20.0][0], rng=np.random.default_rng(3), targets=far)
    with pytest.raises(CampaignError, match=r"target 'far' is found 126\d mm from the TCP, where at most 1000 mm"):
        identify(model, campaign)
    found = identify(model, campaign, target_within=1.5)
    np.testing.assert_allclose(found.T_tool_target[0, :3, 3], far["far"], atol=0.01)


def test_a_fit_that_takes_everything_for_error_is_refused(model, poses):
    """Every row off by its own centimetres: no parameter explains that, and none is wrong beside the others."""
    campaign, _ = simulate(model, poses[20.0][0], rng=np.random.default_rng(3), x=np.zeros(len(model)))
    points = campaign.points + np.random.default_rng(4).normal(size=campaign.points.shape) * 0.01
    with pytest.raises(
        FitError, match=r"no parameter is determined by these rows: .* (9|10)\.\d\d mm per axis .*taskcal doctor"
    ):
        identify(model, replace(campaign, points=points))
