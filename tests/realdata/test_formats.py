"""Files as instruments and people really write them: read, or refused in a sentence that says what they are."""

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.identification.identify import identify
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import average_shots, read_campaign
from taskcal.reading.readings import read_readings
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel

pytestmark = pytest.mark.realdata

READ = {
    "faro_double_space_xyz.txt": (46, ["tool"], False),
    "faro_tracker_tab_thousands_sep.txt": (3, ["tool"], False),
    "joint_angles.xlsx": (10, [], True),
    "joints_irregular_spaces_deg.txt": (10, [], True),
    "leica_tscan_6d_log_crlf.txt": (27, ["tool"], False),
    "optitrack_motive_1.23_trimmed.csv": (4, ["Left", "Left_Marker1"], False),
    "photogrammetry_code_xyz_sigma.csv": (464, ["tool"], False),
    "sa2024_points_ascii_pose1.txt": (3, ["tool"], False),
    "sa_headerless_id_xyz.txt": (15, ["tool"], False),
    "tracker_positions.xlsx": (10, ["tool"], False),
    "ur5_joints_rad_id.txt": (27, [], True),
}


@pytest.mark.parametrize("name", READ)
def test_every_export_is_read(data_folder, name):
    rows, targets, joints = READ[name]
    readings = average_shots(read_readings(data_folder / "formats" / name, load_robot("ur5")))
    assert len(readings) == rows
    assert list(readings.points) == targets
    assert (readings.q is not None) == joints
    for points in readings.points.values():
        assert np.isfinite(points).all()


def test_a_report_in_words_is_called_what_it_is(data_folder):
    with pytest.raises(FileError, match="is labelled text, not a table") as caught:
        read_readings(data_folder / "formats" / "german_decimal_comma_comma_separated.txt", load_robot("ur5"))
    assert "\n" not in str(caught.value)


def test_every_file_is_expected(data_folder):
    files = {path.name for path in (data_folder / "formats").iterdir()} - {"SOURCES.txt"}
    assert files == {*READ, "german_decimal_comma_comma_separated.txt"}


def test_two_raw_files_are_a_campaign(data_folder):
    formats = data_folder / "formats"
    robot = load_robot("ur5")
    campaign = read_campaign(
        formats / "ur5_joints_rad_id.txt", robot, options=ReadOptions(points=formats / "leica_tscan_6d_log_crlf.txt")
    )
    assert len(campaign) == 27
    calibration = identify(ErrorModel(robot), campaign)
    assert calibration.model_error[0] < 0.3e-3
