"""The doctor finds the mistakes that were put into campaigns of virtual robots, and none where there is none."""

import re
from dataclasses import replace

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign, Stations
from taskcal.diagnosis import hypotheses, mistakes
from taskcal.diagnosis.diagnose import MISTAKES, diagnose
from taskcal.diagnosis.hypotheses import Case, Hypothesis, JointMap
from taskcal.errors import CampaignError
from taskcal.identification.identify import identify
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.virtual.cell import simulate
from tests.diagnosis.mistakes import Mistake, every, moved_station, paired
from tests.diagnosis.virtual_campaigns import ROWS, TARGETS, virtual


def of_id(name: str, campaign: Campaign, robot: Robot, said: str = "") -> Mistake:
    return next(m for m in every(campaign, robot) if m.id == name and m.said.startswith(said))


@pytest.mark.parametrize("name", ["ur5", "abb-irb6660-205-1.9", pytest.param("barrett-wam", marks=pytest.mark.long)])
def test_a_sound_campaign_has_no_findings(name):
    assert diagnose(virtual(name, error=5e-4), load_robot(name)).findings == ()


def test_a_sound_campaign_of_poses_has_no_findings():
    assert diagnose(virtual("ur10", pose=True), load_robot("ur10")).findings == ()


@pytest.mark.parametrize(
    ("name", "mistake", "said"),
    [
        ("fanuc-r2000ic-165f", "coupling", "J3 +1"),
        ("abb-irb6660-205-1.9", "joint-order", "J4 and J5"),
        pytest.param("ur5", "joints-in-radians", "", marks=pytest.mark.long),  # as of sockets
        ("barrett-wam", "joints-in-other-unit", "gon as degrees"),
        ("abb-irb120", "joints-in-other-unit", "turns as degrees"),
        pytest.param("denso-hsr065a1", "joints-in-other-unit", "turns as radians", marks=pytest.mark.long),
        ("ur5", "points-in-metres", ""),
        ("ur5", "left-handed", ""),
        ("ur5", "rows-shifted", "+3"),
        pytest.param("abb-irb120", "rows-shuffled", "", marks=pytest.mark.long),
        pytest.param("abb-irb120", "points-in-other-unit", "inches as m", marks=pytest.mark.long),
        pytest.param("ur5", "target-slipped", "5 mm at 40%", marks=pytest.mark.long),
        ("ur5", "gross-rows", "50"),
        ("ur5", "duplicate-poses", ""),
    ],
)
def test_a_mistake_is_the_first_finding(name, mistake, said):
    robot = load_robot(name)
    wrong = of_id(mistake, virtual(name), robot, said)
    first = diagnose(wrong.campaign, robot).findings[0]
    assert first.id == mistake
    if mistake.startswith("joint-") and len(said):
        assert first.subject[0] == said[:2]


@pytest.mark.slow
@pytest.mark.parametrize("mistake", [pytest.param("target-swapped", marks=pytest.mark.long), "target-slipped"])
def test_doctor_mends_what_happens_to_one_of_several_targets(mistake):
    robot = load_robot("kuka-kr16-2")
    sound = virtual("kuka-kr16-2", targets=3)
    found = diagnose(of_id(mistake, sound, robot).campaign, robot)
    assert found.findings[0].id == mistake
    assert "a" in found.findings[0].subject
    assert diagnose(found.campaign, robot).findings == ()


@pytest.mark.parametrize("mistake", ["quaternion-order", "inverse-poses"])
def test_mistakes_of_poses(mistake):
    robot = load_robot("ur10")
    wrong = of_id(mistake, virtual("ur10", pose=True), robot)
    assert diagnose(wrong.campaign, robot).findings[0].id == mistake


@pytest.mark.slow
def test_doctor_finds_two_mistakes_together():
    robot = load_robot("ur5")
    sound = virtual("ur5", rows=16)
    q = sound.q * np.array([1.0, -1.0, 1.0, 1.0, 1.0, 1.0]) + np.array([0.0, 0.0, 0.0, np.pi / 2, 0.0, 0.0])
    found = diagnose(replace(sound, q=q), robot)
    assert {(f.id, f.subject) for f in found.findings[:2]} == {("joint-sign", ("J2",)), ("joint-zero", ("J4",))}
    np.testing.assert_allclose(found.campaign.q, sound.q, atol=1e-12)
    assert identify(ErrorModel(robot), found.campaign).model_error[0] < 1e-3


@pytest.mark.parametrize("said", ["4 mm", pytest.param("400 mm", marks=pytest.mark.long)])
def test_doctor_makes_two_stations_if_the_tracker_moved(said, tmp_path):
    robot, sound = load_robot("ur5"), virtual("ur5", targets=2, rows=60)
    part = sound.take(np.arange(10, 60))
    wrong = of_id("station-moved", part, robot, said)
    found = diagnose(wrong.campaign, robot)
    (first,) = found.findings
    assert (first.id, first.subject) == ("station-moved", wrong.subject)
    row = int(wrong.subject[0])
    assert "two stations in a column station" in first.fix
    assert first.error_after < 0.4 * first.error_before
    assert found.unmended == ()
    write_campaign(tmp_path / "fixed.csv", found.campaign, robot)
    fixed = read_campaign(tmp_path / "fixed.csv", robot)
    assert fixed.stations.rows == (row - 10, 60 - row)
    np.testing.assert_allclose(fixed.points[:, :, 0][: row - 10], wrong.campaign.points[: row - 10, :, 0], atol=1e-8)
    model = ErrorModel(robot)
    apart, sound = identify(model, fixed), identify(model, part)
    assert apart.model_error[0] < 1.2 * sound.model_error[0]
    assert diagnose(fixed, robot).findings == ()


def test_doctor_finds_the_row_of_a_move_in_many_rows():
    robot, sound = load_robot("ur5"), virtual("ur5", rows=520)
    wrong = moved_station(sound, np.arange(520) >= 301, 5.0, 0.2)
    assert diagnose(wrong, robot).findings[0].subject == ("301",)


@pytest.mark.parametrize("targets", [1, 3])
def test_doctor_finds_half_a_millimetre_if_little_else_is_left(targets):
    robot, sound = load_robot("ur5"), virtual("ur5", targets=targets, rows=50, error=0.0)
    wrong = moved_station(sound, np.arange(50) >= 22, 0.5, 0.0)
    assert [(f.id, f.subject) for f in diagnose(wrong, robot).findings] == [("station-moved", ("22",))]


def test_doctor_names_the_parts_if_a_target_was_knocked():
    robot = load_robot("ur5")
    wrong = of_id("target-slipped", virtual("ur5"), robot, "10 mm at 70%")
    first = diagnose(wrong.campaign, robot).findings[0]
    assert (first.id, first.subject) == ("target-slipped", wrong.subject)
    assert "before row 28 (id 28)" in first.fix
    assert first.fix.endswith("--rows 0:28 and --rows 28:40")


@pytest.mark.parametrize(
    "course",
    [
        pytest.param(lambda t: t, marks=pytest.mark.long),
        pytest.param(lambda t: t**2, marks=pytest.mark.long),
        lambda t: 1.0 - np.exp(-4.0 * t),
    ],
)
def test_doctor_calls_slow_motion_drift(course):
    robot, sound = load_robot("ur5"), virtual("ur5", rows=60)
    grown = course(np.linspace(0.0, 1.0, 60))[:, None, None] * np.array([3.0, -3.0, 2.6]) * 1e-3
    assert [f.id for f in diagnose(replace(sound, points=sound.points + grown), robot).findings] == ["drift"]


def test_doctor_names_the_unit_and_the_column_of_inches():
    robot, sound = load_robot("kuka-kr16-2"), virtual("kuka-kr16-2", targets=3)
    points = sound.points.copy()
    points[:, 1] /= 25.4
    found = diagnose(replace(sound, points=points), robot)
    (first,) = found.findings
    assert (first.id, first.subject) == ("points-in-other-unit", ("b",))
    assert "in inches, not millimetres: name their columns with _in instead of _mm, such as x_in" in first.fix
    np.testing.assert_allclose(found.campaign.points, sound.points)


def test_units_nearer_than_the_scatter_tells_are_not_exchanged(monkeypatch):
    """Yards are within the scatter's ratio of metres, so that a sound campaign in metres is not said to be in yards."""
    monkeypatch.setitem(mistakes.OTHER_UNITS, "yd", 0.9144)
    sound = Case.of(load_robot("ur5"), virtual("ur5"))
    assert list(mistakes.scale_mistakes(sound)) == []


@pytest.mark.long
def test_doctor_finds_inches_and_radians_together():
    robot, sound = load_robot("ur5"), virtual("ur5")
    wrong = replace(sound, points=sound.points / 25.4, q=np.radians(sound.q))
    assert {f.id for f in diagnose(wrong, robot).findings} == {"points-in-other-unit", "joints-in-radians"}


@pytest.mark.parametrize(("rows", "targets"), [(3, 1), (7, 1), (5, 3)])
def test_doctor_says_nothing_but_too_few_rows(rows, targets):
    found = diagnose(virtual("ur5", targets=targets).take(np.arange(rows)), load_robot("ur10"))
    (only,) = found.findings
    assert (only.id, only.error_before, only.error_after) == ("too-few-rows", None, None)
    assert only.fix.startswith(f"{rows} measured rows are too few")
    assert found.unmended == ("too-few-rows",)


@pytest.mark.parametrize("joint", [None, 0, 3, 5])
def test_doctor_says_nothing_but_that_one_joint_moves(joint):
    robot, sound = load_robot("ur5"), virtual("ur5")
    q = np.tile(sound.q[0], (len(sound), 1))
    if joint is not None:
        q[:, joint] = sound.q[:, joint]
    points = simulate(ErrorModel(robot), q, rng=np.random.default_rng(0))[0]
    (only,) = diagnose(points, robot).findings
    assert (only.id, only.error_before, only.error_after) == ("one-joint-moves", None, None)
    name = "no joint" if joint is None else f"only {robot.joint_names[joint]}"
    assert only.fix.startswith(f"{name} moves")
    assert "at least three joints move" in only.fix


def test_doctor_promises_no_smaller_error_if_nothing_helps():
    robot, sound = load_robot("ur5"), virtual("ur5", rows=12)
    wrong = replace(sound, points=sound.points + np.random.default_rng(0).normal(size=sound.points.shape) * 0.2)
    (only,) = diagnose(wrong, robot).findings
    assert only.error_after is None


def test_joint_limits_distinguish_half_a_turn_from_a_sign():
    robot = load_robot("abb-irb120")
    wrong = of_id("joint-zero", virtual("abb-irb120"), robot, "J2 by 180")
    first, *others = diagnose(wrong.campaign, robot).findings
    assert (first.id, first.subject) == ("joint-zero", ("J2",))
    assert ("joint-sign", ("J1",)) in {(f.id, f.subject) for f in others}


@pytest.mark.parametrize(
    ("name", "said"), [("ur5", "J2 by 180"), pytest.param("abb-irb1200-5-0.9", "J4 by 180", marks=pytest.mark.long)]
)
def test_a_usual_posture_decides_between_mirrored_robots(name, said):
    """With the other sign of J1 the UR5 would hang from the ceiling; with that of J5 the wrist would stay turned by half a turn."""
    robot = load_robot(name)
    wrong = of_id("joint-zero", virtual(name), robot, said)
    first = diagnose(wrong.campaign, robot).findings[0]
    assert (first.id, first.subject) == ("joint-zero", (said[:2],))


@pytest.mark.long
def test_half_of_the_rows_shifted_by_one_are_a_shift():
    robot, sound = load_robot("ur5"), virtual("ur5")
    order = np.r_[np.arange(20), np.roll(np.arange(20, ROWS), 1)]
    found = diagnose(paired(sound, order), robot)
    assert found.findings[0].id == "rows-shifted"
    np.testing.assert_array_equal(found.campaign.points, sound.points)


def test_another_robot_is_named():
    findings = diagnose(virtual("ur10"), load_robot("ur5")).findings
    assert findings[0].id == "other-robot"
    assert findings[0].subject[0].startswith("ur10")


def test_poses_in_one_orientation_are_too_few_and_those_in_one_corner_are_of_that_corner():
    robot = load_robot("ur5")
    model, rng = ErrorModel(robot), np.random.default_rng(3)
    middle = np.array([0.2, -1.2, 1.4, -1.0, -1.2, 0.4])
    q = middle + rng.uniform(-0.05, 0.05, (ROWS, 6))
    campaign = simulate(model, q, rng=rng, targets={"tool": TARGETS["a"]})[0]
    found = diagnose(campaign, robot)
    assert [f.id for f in found.findings] == ["few-orientations"]
    assert re.fullmatch(r"the positions spread by \d+ mm .*: enough for a task in this place; .*", found.scope)


def test_findings_are_ranked_shares_with_one_line_that_mends():
    robot = load_robot("ur5")
    findings = diagnose(of_id("joint-sign", virtual("ur5"), robot, "J3").campaign, robot).findings
    assert (findings[0].id, findings[0].subject) == ("joint-sign", ("J3",))
    for finding in findings:
        assert finding.id in MISTAKES
        assert 0.0 < finding.confidence < 1.0
        assert finding.error_after < finding.error_before
        assert finding.fix
        assert "\n" not in finding.fix
        assert set(finding.as_json()) == {
            "id", "subject", "error_before_mm", "error_after_mm", "confidence", "fix", "alternative",
        }  # fmt: skip


def test_doctor_refuses_what_the_controller_calculates():
    robot, sound = load_robot("ur5"), virtual("ur5")
    points = ErrorModel(robot).poses(sound.q)[:, None, :3, 3].round(5)
    shown = replace(sound, points=points, lines=np.arange(len(points)))
    with pytest.raises(CampaignError, match="was calculated, not measured"):
        diagnose(shown, robot)


def test_doctor_finds_a_mistake_that_is_only_registered(monkeypatch):
    """A mistake is one entry: search, ranking, fix and mended campaign follow from its hypotheses."""
    robot, sound = load_robot("ur5"), virtual("ur5")

    def doubled(case):
        """The encoder of one joint is behind a gear."""
        for j, name in enumerate(robot.joint_names):
            matrix = np.eye(6)
            matrix[j, j] = 0.5
            half = JointMap(matrix=matrix, offset=np.zeros(6))
            yield Hypothesis(id="joint-doubled", subject=(name,), joints=half, fix=f"halve {name}")

    entry = hypotheses.Mistake(id="joint-doubled", part="joints", find=doubled)
    monkeypatch.setitem(MISTAKES, "joint-doubled", entry)
    q = sound.q.copy()
    q[:, 1] *= 2.0
    found = diagnose(replace(sound, q=q), robot)
    assert [(f.id, f.subject, f.fix) for f in found.findings] == [("joint-doubled", ("J2",), "halve J2")]
    np.testing.assert_allclose(found.campaign.q, sound.q, atol=1e-12)


def test_a_hypothesis_of_no_registered_mistake_is_refused(monkeypatch):
    def misspelt(case):
        yield Hypothesis(id="joint-singn", subject=("J1",), fix="")

    monkeypatch.setitem(MISTAKES, "joint-sign", replace(MISTAKES["joint-sign"], find=misspelt))
    with pytest.raises(ValueError, match="misspelt yields 'joint-singn', which its @looked_for does not name"):
        diagnose(virtual("ur5"), load_robot("ur5"))


def test_stations_of_too_few_rows_are_all_named():
    """Each is examined by itself, so that rows of several do not add up."""
    sound = virtual("ur5", rows=15)
    stations = Stations(names=("a", "b", "c"), of=np.arange(15) // 5, T_first_station=np.tile(np.eye(4), (3, 1, 1)))
    found = diagnose(replace(sound, stations=stations), load_robot("ur5"))
    assert [(finding.id, finding.error_after) for finding in found.findings] == [("too-few-rows", None)]
    assert found.scope.endswith("too little to examine: a, b, c")
