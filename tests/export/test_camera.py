"""The camera of a calibration from images, in the files of ROS and OpenCV."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import cv2
import numpy as np
import pytest
import yaml

from taskcal.errors import TaskcalError
from taskcal.export.camera import (
    Camera,
    export_camera_info,
    export_camera_toml,
    export_camera_urdf,
    export_opencv_yaml,
)
from taskcal.export.descriptions import export_description, links_of
from taskcal.geometry import se3
from taskcal.geometry.euler import from_angles
from taskcal.identification.calibration import Calibration
from taskcal.identification.identify import identify
from taskcal.identification.options import FitOptions
from taskcal.observations import read_camera
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.calibrations import calibrated
from tests.observations.pictured import CAMERA, CORNERS, MODEL, Pictured, take_pictures
from tests.observations.rig import wrist_and_floor


@pytest.fixture(scope="module", params=[True, False], ids=["on the wrist", "beside the robot"])
def found(request) -> tuple[Pictured, Calibration]:
    true = take_pictures(3, on_wrist=request.param)
    return true, identify(MODEL, true.campaign())


def test_the_exported_camera_projects_as_the_true_one(found):
    """Through OpenCV, with board and robot: to a few pixels of corners that have noise of 0.15, as far as the robot is known."""
    true, calibration = found
    camera = Camera.of(calibration)
    there = true.moving if true.on_wrist else true.standing
    assert np.linalg.norm(camera.T_parent_camera[:3, 3] - there[:3, 3]) < 0.02
    assert np.linalg.norm(se3.log(camera.T_parent_camera[:3, :3] @ there[:3, :3].T)) < 0.02
    board = np.array([0.0, 0.0, 0.5]) - CORNERS.mean(axis=0)
    at = cv2.projectPoints(CORNERS, np.zeros(3), board, camera.matrix, camera.distortion)[0]
    fx, fy, cx, cy = CAMERA[:4] * 1e3
    truth = cv2.projectPoints(CORNERS, np.zeros(3), board, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), CAMERA[4:])[
        0
    ]
    off = (at - truth).reshape(-1, 2)
    assert np.abs(off - off.mean(axis=0)).max() < 3.0


def test_every_file_reads_back_as_it_was_written(found, tmp_path):
    _, calibration = found
    camera = Camera.of(calibration)
    info = yaml.safe_load(export_camera_info(calibration).text)
    assert (info["image_width"], info["image_height"]) == (camera.lens.width, camera.lens.height)
    assert info["distortion_model"] == "plumb_bob"
    np.testing.assert_array_equal(np.reshape(info["camera_matrix"]["data"], (3, 3)), camera.matrix)
    np.testing.assert_array_equal(info["distortion_coefficients"]["data"], camera.distortion)
    np.testing.assert_array_equal(np.reshape(info["projection_matrix"]["data"], (3, 4))[:, :3], camera.matrix)

    path = tmp_path / "camera.yaml"
    path.write_text(export_opencv_yaml(calibration).text, encoding="utf-8")
    store = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(store.getNode("camera_matrix").mat(), camera.matrix)
    np.testing.assert_array_equal(store.getNode("distortion_coefficients").mat()[0], camera.distortion)
    pose = "T_tool_camera" if camera.on_wrist else "T_base_camera"
    np.testing.assert_array_equal(store.getNode(pose).mat(), camera.T_parent_camera)

    files = {"a.yaml": export_camera_info, "b.yml": export_opencv_yaml, "c.toml": export_camera_toml}
    for name, export in files.items():
        (tmp_path / name).write_text(export(calibration).text, encoding="utf-8")
        read = read_camera(tmp_path / name)
        assert read.lens == camera.lens
        numbers = np.concatenate([camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]] / 1e3, camera.distortion])
        np.testing.assert_allclose(read.numbers, numbers, rtol=1e-14)
    np.testing.assert_allclose(read.uncertainty[:4] * 1e3, camera.error[:4], rtol=1e-12)

    joint = ET.fromstring(export_camera_urdf(calibration).text).find("joint")
    description = ET.fromstring(export_description(calibration, "urdf", accept_loss=True, accept_uncertain=True).text)
    ends = {link.get("name") for link in description.findall("link")}
    assert joint.find("parent").get("link") == camera.parent == ("tool0" if camera.on_wrist else "base_link")
    assert camera.parent in ends
    robot = robot_from({**calibration.model.robot.description, "links": ["world & base", "hand"]})
    own = replace(calibration, model=ErrorModel(robot))
    named = ET.fromstring(export_camera_urdf(own).text).find("joint").find("parent").get("link")
    assert named == ("hand" if camera.on_wrist else "world & base")
    renamed = ET.fromstring(export_description(own, "urdf", accept_loss=True, accept_uncertain=True).text)
    assert {link.get("name") for link in renamed.findall("link")} == ends - {"base_link", "tool0"} | {
        "world & base",
        "hand",
    }
    (root,) = {one.find("parent").get("link") for one in renamed.findall("joint")} - {
        one.find("child").get("link") for one in renamed.findall("joint")
    }
    assert root == "world & base"
    clash = robot_from({**calibration.model.robot.description, "links": ["base", f"{robot.joint_names[-1]}_link"]})
    assert links_of(clash) == ("base_link", "tool0")
    xyz, rpy = (np.array(joint.find("origin").get(key).split(), dtype=float) for key in ("xyz", "rpy"))
    T = se3.pose(from_angles("rpy", rpy[None])[0], xyz)
    np.testing.assert_allclose(T, camera.T_parent_camera, atol=1e-12)


def test_a_calibration_without_images_has_no_camera():
    with pytest.raises(TaskcalError, match="has no camera"):
        export_camera_info(calibrated("ur5"))


def test_the_camera_of_several_is_named():
    """Without a name, or with another one, the names of all are said."""
    rig = wrist_and_floor(1, 12, error=5e-5)
    calibration = identify(MODEL, rig.campaign(), options=FitOptions(keep=()))
    for words in ({}, {"name": "other"}):
        with pytest.raises(TaskcalError, match="wrist, cell"):
            export_camera_toml(calibration, **words)
    for name in ("wrist", "cell"):
        camera = Camera.of(calibration, name)
        export = export_camera_urdf(calibration, name)
        assert camera.link == f"camera_{name}_optical_frame"
        assert f'link name="{camera.link}"' in export.text
        assert camera.on_wrist == (name == "wrist")
        there = rig.bodies[f"camera {name}"]
        assert np.linalg.norm(camera.T_parent_camera[:3, 3] - there[:3, 3]) < 0.03
