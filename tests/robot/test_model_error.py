"""The model error assumed before anything is measured: as stated, as the robot's file says, or of a typical robot."""

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.identification.identify import identify
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import TYPICAL, model_error_of
from taskcal.robot.robot_file import read_robot

MEASURED = {
    "ur5": "ur5_tracker",
    "ur10": "ur10_tmac",
    "barrett-wam": "wam_tracker",
    "abb-irb120": "irb120_faro",
    "fanuc-r2000ic-165f": "fanuc_r2000_tracker",
}
LINE = 'name = "slide"\n[[joint]]\nname = "X"\ntype = "prismatic"\n'


@pytest.mark.realdata
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow if n == "ur5" else ()) for n in MEASURED])
def test_a_measured_robots_file_states_what_its_campaign_shows(data_folder, name):
    robot = load_robot(name)
    campaign = read_campaign(data_folder / MEASURED[name] / "measurements.csv", robot)
    shown = identify(ErrorModel(robot), campaign).model_error[0]
    assert model_error_of(robot).position == pytest.approx(shown, rel=0.01)


def test_a_typical_robot_is_the_median_of_the_measured_ones():
    stated = [model_error_of(load_robot(name)).position for name in MEASURED]
    assert TYPICAL.position == pytest.approx(np.median(stated), rel=0.02)
    assert "0.06 to 1.34 mm" in TYPICAL.source
    assert (min(stated), max(stated)) == pytest.approx((0.064e-3, 1.34e-3))


def test_stated_model_errors_are_the_published_residuals():
    """The largest of 60 residuals per axis and in space, of a fit with 35 unknowns, with a tracker four metres away."""
    robot = load_robot("abb-irb6660-205-1.9")
    rng = np.random.default_rng(0)
    tracker = 0.5 * (15e-6 + 4.0 * 6e-6)
    deviation = np.hypot(model_error_of(robot).position, tracker) * np.sqrt(1.0 - 35 / 180)
    residuals = deviation * rng.normal(size=(4000, 60, 3)) * 1e3
    largest = np.abs(residuals).max(axis=1).mean(axis=1)
    in_space = np.linalg.norm(residuals, axis=2).max(axis=1)
    # both published figures are likely of it: per axis on the small side, in space on the large
    assert np.percentile(largest, 5) - 0.01 < np.mean([0.096, 0.122, 0.092]) < np.median(largest) + 0.01
    assert np.median(in_space) < 0.180 < np.percentile(in_space, 95)


def test_model_error_given_then_file_then_typical(tmp_path):
    """What is given comes first then the file then a typical robot."""
    path = tmp_path / "slide.toml"
    path.write_text(LINE)
    assert model_error_of(read_robot(path)) is TYPICAL
    path.write_text(LINE + '[model_error]\nposition_mm = 0.03\nsource = "my own measurements"\n')
    stated = model_error_of(read_robot(path))
    assert (stated.position, stated.source) == (pytest.approx(3e-5), "my own measurements")
    given = model_error_of(read_robot(path), 0.0)
    assert (given.position, given.source) == (0.0, "as given")


def test_a_negative_model_error_is_refused(tmp_path):
    path = tmp_path / "slide.toml"
    path.write_text(LINE + "[model_error]\nposition_mm = -0.03\n")
    with pytest.raises(FileError, match=r"model_error.*position_mm"):
        read_robot(path)
