"""Files of cameras: forms of others are read, and what a fit does not have is refused."""

import pytest

from taskcal.errors import FileError
from taskcal.observations import read_camera

ROS = """image_width: 1600
image_height: 1200
camera_name: left
camera_matrix:
  rows: 3
  cols: 3
  data: [1450.0, 0.0, 810.0, 0.0, 1452.0, 600.0, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.12, 0.08, 0.0005,
         -0.0008, 0.0]
"""
TOML = "[camera]\nwidth = 1600\nheight = 1200\nfx = 1450.0\n"

WRONG = {
    "no size": ("a.yaml", ROS.replace("image_width: 1600\n", ""), "states no image_width"),
    "rational": ("a.yaml", ROS.replace("-0.0008, 0.0]", "-0.0008, 0.0, 0.1, 0.0, 0.2]"), "8 distortion"),
    "skew": ("a.yaml", ROS.replace("[1450.0, 0.0", "[1450.0, 2.0"), "is not fx 0 cx"),
    "two cameras": ("a.yaml", f"{ROS}---\n{ROS}", "has 2 documents"),
    "no distortion": ("a.yaml", ROS[: ROS.index("distortion_coefficients")], "without distortion are zeros"),
    "another model": ("a.yaml", ROS.replace("plumb_bob", "omni"), "distortion model 'omni'"),
    "a text": ("a.yaml", ROS.replace("1450.0", "wide"), "camera_matrix with numbers"),
    "no YAML": ("a.yaml", "a: [1\n", "is not YAML"),
    "a fisheye's p1": ("a.toml", f'{TOML}lens = "fisheye"\n[camera.distortion]\np1 = 0.1\n', "'p1'"),
    "focus": ("a.toml", f"{TOML}[camera.focus]\nnearest_mm = 500.0\nfarthest_mm = 400.0\n", "swap them"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_no_fit_has_is_refused_with_the_reason(tmp_path, case):
    name, text, said = WRONG[case]
    (tmp_path / name).write_text(text)
    with pytest.raises(FileError, match=said):
        read_camera(tmp_path / name)


def test_yaml_of_ros_is_read_over_lines(tmp_path):
    (tmp_path / "a.yaml").write_text(f"{ROS}---\n")  # as ros2 topic echo ends
    found = read_camera(tmp_path / "a.yaml")
    assert found.numbers.tolist() == [1.45, 1.452, 0.81, 0.6, -0.12, 0.08, 0.0005, -0.0008, 0.0]
    assert (found.lens.width, found.lens.height, found.uncertainty) == (1600, 1200, None)
