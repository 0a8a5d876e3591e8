"""Rotations that cannot be those of positions that fit: left out, refused and named, whatever is wrong with them."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign
from taskcal.diagnosis.diagnose import diagnose
from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import campaign_text
from taskcal.registration.rotations import fit_rotations, leave_out_wrong_rotations
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.diagnosis.virtual_campaigns import virtual

ROBOTS = "ur5e", "kuka-kr16-2", "franka-panda", "abb-irb6660-205-1.9", "staubli-rx160"


def angles(Y: np.ndarray) -> np.ndarray:
    """About moving z, y, x."""
    pitch = np.arctan2(-Y[:, 2, 0], np.hypot(Y[:, 0, 0], Y[:, 1, 0]))
    return np.stack([np.arctan2(Y[:, 1, 0], Y[:, 0, 0]), pitch, np.arctan2(Y[:, 2, 1], Y[:, 2, 2])], axis=1)


def wrong_rotations(Y: np.ndarray, rng: np.random.Generator) -> Iterator[tuple[str, str, np.ndarray]]:
    """What is wrong, what the doctor calls it, and the rotations."""
    q, lost, mirror = se3.to_quaternion(Y), Y.copy(), np.diag([1.0, -1.0, 1.0])
    lost[::3] = np.eye(3)
    yield "never measured", "rotations-unmeasured", np.tile(np.eye(3), (len(Y), 1, 1))
    yield "constant", "rotations-unmeasured", np.tile(se3.exp(np.array([0.4, 1.0, -0.3])), (len(Y), 1, 1))
    yield "lost in a third", "rotations-unmeasured", lost
    yield "w x y z", "quaternion-order", se3.from_quaternion(q[:, [3, 0, 1, 2]])
    yield "transposed", "inverse-poses", np.swapaxes(Y, 1, 2).copy()
    yield "mirrored", "rotations-turned", mirror @ Y @ mirror
    yield "permuted", "rotations-turned", np.ascontiguousarray(Y[:, [1, 2, 0]])
    yield "a row late", "rotations-shifted", np.roll(Y, 1, axis=0)
    yield "two rows early", "rotations-shifted", np.roll(Y, -2, axis=0)
    yield "of other poses", "rotations-unknown", Y[rng.permutation(len(Y))]
    yield "z y z", "rotations-unknown", se3.turns("zyz", angles(Y))
    yield "fixed for moving", "rotations-unknown", se3.turns("xyz", angles(Y))
    yield "degrees for radians", "rotations-unknown", se3.turns("zyx", angles(Y) * 180.0 / np.pi)
    yield "radians for degrees", "rotations-unknown", se3.turns("zyx", angles(Y) * np.pi / 180.0)


def posed(name: str, seed: int) -> Campaign:
    return virtual(name, seed, pose=True, rows=30, error=1e-4)


@pytest.mark.parametrize("name", ROBOTS)
def test_wrong_rotations_are_left_out_and_refused_and_right_ones_kept(name):
    """Of every kind; a target that is turned otherwise on the tool is right."""
    model, campaign = ErrorModel(load_robot(name)), posed(name, 1)
    assert campaign.rotations is not None
    other = replace(campaign, rotations=campaign.rotations @ se3.exp(np.array([1.0, 2.0, -0.5])))
    for right in (campaign, other):
        assert leave_out_wrong_rotations(model, right) is right
    for kind, _, Y in wrong_rotations(campaign.rotations, np.random.default_rng(0)):
        wrong = replace(campaign, rotations=Y)
        left = leave_out_wrong_rotations(model, wrong)
        assert left.rotations is None, kind
        assert "All rotations are left out" in left.notes[-1]
        assert np.array_equal(left.points, campaign.points)
        with pytest.raises(CampaignError, match="leave them out"):
            identify(model, wrong)


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_doctor_names_what_is_wrong_with_rotations(name):
    """It names rotations, neither robot nor joints, and nothing else; lost ones by their rows. Every kind of one robot of five."""
    robot, campaign = load_robot(name), posed(name, 2)
    assert campaign.rotations is not None
    assert diagnose(campaign, robot).findings == ()
    kinds = list(wrong_rotations(campaign.rotations, np.random.default_rng(0)))
    for kind, called, Y in kinds[ROBOTS.index(name) :: len(ROBOTS)]:
        found = diagnose(replace(campaign, rotations=Y), robot)
        assert [finding.id for finding in found.findings] == [called], kind
        if kind == "lost in a third":
            assert found.findings[0].subject == campaign.ids[::3]
        if called in ("quaternion-order", "inverse-poses", "rotations-shifted"):
            fit = fit_rotations(ErrorModel(robot), found.campaign)
            assert fit is not None
            assert not fit.wrong.any(), kind


@pytest.mark.slow
def test_doctor_names_joints_and_rotations_that_are_wrong_at_once():
    robot, campaign = load_robot("ur5e"), posed("ur5e", 3)
    q = campaign.q.copy()
    q[:, 2] *= -1.0
    wrong = replace(campaign, q=q, rotations=np.tile(np.eye(3), (len(q), 1, 1)))
    found = diagnose(wrong, robot)
    assert [(one.id, one.subject) for one in found.findings if not one.alternative] == [
        ("joint-sign", (robot.joint_names[2],)),
        ("rotations-unmeasured", ()),
    ]


@pytest.mark.parametrize("step", [0.3, 1.0, 3.0])
def test_rotations_of_the_row_before_are_found_in_slow_motion_too(step):
    """Of a robot that turns by tenths of a degree from row to row a late rotation is off by little, and still told."""
    robot, rng = load_robot("ur5e"), np.random.default_rng(1)
    sweep = 0.5 * np.sin(np.linspace(0.0, 3.0, 60)[:, None] * np.arange(1, 7) * step / 3.0)
    q = np.cumsum(np.radians(step) * rng.normal(size=(60, 6)), axis=0) + sweep + [0.0, -1.5, 1.5, -1.2, -1.4, 0.3]
    campaign = simulate(ErrorModel(robot), q, rng=rng, pose=True, model_error=5e-5)[0]
    assert campaign.rotations is not None
    sound = fit_rotations(ErrorModel(robot), campaign)
    late = fit_rotations(ErrorModel(robot), replace(campaign, rotations=np.roll(campaign.rotations, 1, axis=0)))
    assert sound is not None
    assert late is not None
    assert (sound.shift, sound.few) == (0, True)
    assert (late.shift, late.few) == (1, False)


def test_rotations_beyond_tolerances_are_never_fitted_without_a_remark():
    """What is off by less than is refused: turned at random by 1 or 2°, beside a tolerance of tenths."""
    model, campaign = ErrorModel(load_robot("ur5e")), posed("ur5e", 4)
    assert campaign.rotations is not None
    assert identify(model, campaign).remarks == ()
    rng = np.random.default_rng(0)
    for degrees in (1.0, 2.0):
        turn = se3.exp(np.radians(degrees / np.sqrt(3.0)) * rng.normal(size=(len(campaign), 3)))
        said = identify(model, replace(campaign, rotations=turn @ campaign.rotations)).remarks
        assert any(remark.startswith("rotations are") for remark in said), degrees


def test_file_with_rotations_never_measured_is_as_good_as_its_points(tmp_path):
    """The file is read without them, with a note; positions are calibrated as from points alone."""
    robot, campaign = load_robot("kuka-kr16-2"), posed("kuka-kr16-2", 5)
    wrong = replace(campaign, rotations=np.tile(np.eye(3), (len(campaign), 1, 1)))
    (tmp_path / "poses.csv").write_text(campaign_text(wrong, robot))
    (tmp_path / "points.csv").write_text(campaign_text(replace(campaign, rotations=None), robot))
    poses, points = (read_campaign(tmp_path / name, robot) for name in ("poses.csv", "points.csv"))
    assert "all rows have one rotation" in poses.notes[-1]
    assert poses.rotations is None
    model = ErrorModel(robot)
    assert identify(model, poses).z == pytest.approx(identify(model, points).z, abs=1e-12)


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("case", "called", "rows"),
    [
        ("rotation-never-measured", "rotations-unmeasured", 0),
        ("rotation-lost-in-a-third", "rotations-unmeasured", 20),
        ("zyz", "rotations-unknown", 0),
    ],
)
def test_cases(case, called, rows, data_folder):
    robot, path = load_robot("ur5e"), data_folder / f"cases/measurements/{case}.csv"
    assert read_campaign(path, robot).rotations is None
    from taskcal.cli.commands.doctor import diagnose_file

    (finding,) = diagnose_file(path, robot).findings
    assert (finding.id, len(finding.subject)) == (called, rows)


@pytest.mark.realdata
def test_rotations_of_a_measured_robot_fit(data_folder):
    model = ErrorModel(load_robot("ur10"))
    campaign = read_campaign(data_folder / "ur10_tmac/measurements.csv", model.robot)
    fit = fit_rotations(model, campaign)
    assert fit is not None
    assert fit.shift == 0
    assert not fit.wrong.any()
