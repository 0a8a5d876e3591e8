"""The doctor on measured robots: none of their campaigns is called wrong, and mistakes put into them are found.

The thresholds for slips and drifts were raised on drawn robots; those for sound fits and few orientations were chosen with the
sound campaigns of these robots in view, so that this is no independent proof that there are no false alarms.
"""

import re
from dataclasses import replace

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign
from taskcal.diagnosis.diagnose import diagnose
from taskcal.identification.calibration import COURSE_IN_DOUBT
from taskcal.identification.identify import identify
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.importers.dh import read_dh_table
from taskcal.robot.robot import Robot

pytestmark = pytest.mark.realdata

FOLDERS = {
    "ur5": "ur5_tracker",
    "ur10": "ur10_tmac",
    "barrett-wam": "wam_tracker",
    "abb-irb120": "irb120_faro",
    "fanuc-r2000ic-165f": "fanuc_r2000_tracker",
}
ROWS = 60


def sixty_rows(data_folder, name: str, robot: Robot) -> Campaign:
    whole = read_campaign(data_folder / FOLDERS[name] / "measurements.csv", robot)
    rows = np.random.default_rng(1).permutation(len(whole))[:ROWS]
    return whole.take(np.sort(rows))


@pytest.mark.parametrize("name", FOLDERS)
def test_a_measured_campaign_has_no_findings(data_folder, name):
    robot = load_robot(name)
    assert diagnose(sixty_rows(data_folder, name, robot), robot).findings == ()


@pytest.mark.parametrize("name", FOLDERS)
def test_a_fit_names_what_happened_and_nothing_else(data_folder, name):
    """In the order of the file; a slip of ten model errors is put in at its middle."""
    model = ErrorModel(load_robot(name))
    sound = sixty_rows(data_folder, name, model.robot)
    calibration = identify(model, sound)
    assert not any(remark.startswith(COURSE_IN_DOUBT) for remark in calibration.remarks)
    row, by = len(sound) // 2, 10.0 * calibration.model_error[0] * np.array([0.6, -0.6, 0.53])
    points = sound.points.copy()
    tool = calibration.predict_tool(sound.q)[row:, :3, :3]
    points[row:, 0] += tool @ by
    said = [one for one in identify(model, replace(sound, points=points)).remarks if one.startswith(COURSE_IN_DOUBT)]
    assert len(said) == 1
    assert float(re.search(r"slipped by ([\d.]+) mm", said[0])[1]) == pytest.approx(1e3 * np.linalg.norm(by), rel=0.2)
    # other rows of the file may lie between those that were drawn
    assert re.search(rf"(?:before|and) row {sound.row_of(row)} ", said[0])


def test_a_posture_in_which_the_robot_bends_is_not_a_gross_row(data_folder):
    """Where it leans far back this robot is off by four millimetres, and by a tenth of that elsewhere."""
    robot = load_robot("abb-irb120")
    whole = read_campaign(data_folder / FOLDERS["abb-irb120"] / "measurements.csv", robot)
    assert diagnose(whole.take(slice(0, ROWS)), robot).findings == ()


def test_a_zero_that_few_rows_show_is_no_row_fault(data_folder):
    """Where each joint was moved alone, most rows say nothing of the fourth one's zero."""
    robot = load_robot("fanuc-r2000ic-165f")
    sound = sixty_rows(data_folder, robot.name, robot)
    wrong = replace(sound, q=sound.q + np.radians([0.0, 0.0, 0.0, 90.0, 0.0, 0.0]))
    first = diagnose(wrong, robot).findings[0]
    assert (first.id, first.subject) == ("joint-zero", ("J4",))


def test_moved_wrist_registers_in_every_half_of_rows(data_folder):
    """Half of these rows end in another minimum than all of them, at a fifth of a metre."""
    robot = load_robot("fanuc-r2000ic-165f")
    whole = read_campaign(data_folder / FOLDERS[robot.name] / "measurements.csv", robot)
    found = diagnose(whole.take(slice(18, 36)), robot)
    assert found.findings == ()
    assert "enough for a task in this place" in found.scope


def test_poses_of_one_orientation_are_registered_by_their_points(data_folder):
    robot = load_robot("ur10")
    whole = read_campaign(data_folder / FOLDERS["ur10"] / "measurements.csv", robot)
    turned = 3.0 - np.einsum("ij,nij->n", whole.rotations[500], whole.rotations)
    alike = np.sort(np.argsort(turned)[:40])
    assert [f.id for f in diagnose(whole.take(alike), robot).findings] == ["few-orientations"]


@pytest.mark.parametrize(
    ("name", "mistaken"), [("ur5", "mdh"), pytest.param("abb-irb120", "dh", marks=pytest.mark.long)]
)
def test_a_table_of_the_other_convention_is_found(data_folder, name, mistaken):
    (table,) = (data_folder / FOLDERS[name]).glob("nominal_*.csv")
    campaign = sixty_rows(data_folder, name, load_robot(name))
    assert diagnose(campaign, read_dh_table(table, mistaken)).findings[0].id == "dh-convention"
