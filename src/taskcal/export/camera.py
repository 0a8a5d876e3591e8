"""The camera of a calibration from images, and where it is, for ROS and OpenCV."""

from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import tomli_w
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.export.descriptions import BASE, tip_of
from taskcal.export.forms import Export, Loss, placed
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.observations import Pixels
from taskcal.observations.camera import DISTORTION, KILO, Lens

OPTICAL = "camera_optical_frame"
"""Link of the camera: x to the right and y down in the image, z forward (REP 103)."""

ROS_MODELS = {"pinhole": "plumb_bob", "fisheye": "equidistant"}
"""Distortion models of ``sensor_msgs/CameraInfo`` with the coefficients of each lens, in OpenCV's order."""

EXACT = Loss(rms=0.0, maximum=0.0, poses=0, reasons=())


@dataclass(frozen=True, eq=False, kw_only=True)
class Camera:
    """A camera that was found."""

    lens: Lens
    matrix: Float[np.ndarray, "3 3"]
    """Focal lengths and centre, pixels; the middle of the first pixel is at zero."""
    distortion: Float[np.ndarray, " k"]
    """In OpenCV's order."""
    error: Float[np.ndarray, " n"]
    """Standard errors of focal lengths and centre, pixels, and of the distortion."""
    on_wrist: bool
    parent: str
    """Link that it is fixed to, of the robot's tool or base: as the description has it that the robot was imported from, else as
    exported descriptions do (`export_description`)."""
    T_parent_camera: Float[np.ndarray, "4 4"]
    """Metres."""

    @classmethod
    def of(cls, calibration: Calibration) -> "Camera":
        """The camera of a calibration.

        Raises:
            TaskcalError: it was not made from images.
        """
        layout, robot = calibration.layout, calibration.model.robot
        found = [t for t, kind in enumerate(layout.kinds) if isinstance(kind, Pixels)]
        if not found:
            raise TaskcalError(
                "this calibration has no camera: it was not made from images (taskcal identify --images)"
            )
        kind = layout.kinds[found[0]]
        assert isinstance(kind, Pixels)
        assert kind.lens is not None
        values = dict(zip(kind.unknowns, layout.unknowns(calibration.z)[found[0]], strict=True))
        deviation = np.sqrt(np.maximum(np.diag(calibration.z_covariance), 0.0))[layout.own[found[0]]]
        errors = dict(zip(kind.unknowns, deviation, strict=True))
        fx, fy, cx, cy = (float(values[f"camera.{name}"]) * KILO for name in ("fx", "fy", "cx", "cy"))
        if kind.on_wrist:
            T = calibration.T_tool_target[found[0]]
        else:
            at = np.array([values[f"camera.{name}"] for name in ("tx", "ty", "tz", "rx", "ry", "rz")])
            T = se3.inverse(calibration.T_tracker_base) @ se3.pose(se3.exp(at[3:]), at[:3])
        return cls(
            lens=kind.lens,
            matrix=np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
            distortion=np.array([values[f"camera.{name}"] for name in DISTORTION[kind.lens.model]]),
            error=np.array([errors[f"camera.{name}"] * KILO ** (name[0] in "fc") for name in kind.lens.unknowns]),
            parent=(robot.links or (BASE, tip_of(robot)))[kind.on_wrist],
            on_wrist=kind.on_wrist,
            T_parent_camera=T,
        )

    def exported(self, text: str) -> Export:
        """A file with this camera, and its pose beside."""
        where = "camera in the tool" if self.on_wrist else "camera in the base"
        return Export(text=text, loss=EXACT, frames={where: self.T_parent_camera})


def export_camera_info(calibration: Calibration) -> Export:
    """The camera as ROS keeps it (``camera_info``, of camera_calibration_parsers).

    Raises:
        TaskcalError: the calibration was not made from images.
    """
    camera = Camera.of(calibration)
    K, D = camera.matrix, camera.distortion
    lines = [
        f"image_width: {camera.lens.width}",
        f"image_height: {camera.lens.height}",
        "camera_name: camera",
        *_matrix("camera_matrix", K),
        f"distortion_model: {ROS_MODELS[camera.lens.model]}",
        *_matrix("distortion_coefficients", D[None]),
        *_matrix("rectification_matrix", np.eye(3)),
        *_matrix("projection_matrix", np.column_stack([K, np.zeros(3)])),
    ]
    return camera.exported("\n".join(lines) + "\n")


def export_opencv_yaml(calibration: Calibration) -> Export:
    """The camera and its pose as OpenCV's FileStorage reads them.

    Raises:
        TaskcalError: the calibration was not made from images.
    """
    camera = Camera.of(calibration)
    tag = " !!opencv-matrix"
    lines = [
        "%YAML:1.0",
        "---",
        f"image_width: {camera.lens.width}",
        f"image_height: {camera.lens.height}",
        f"lens: {camera.lens.model}",
        *_matrix("camera_matrix", camera.matrix, tag, type="d"),
        *_matrix("distortion_coefficients", camera.distortion[None], tag, type="d"),
        *_matrix("T_tool_camera" if camera.on_wrist else "T_base_camera", camera.T_parent_camera, tag, type="d"),
    ]
    return camera.exported("\n".join(lines) + "\n")


def export_camera_toml(calibration: Calibration) -> Export:
    """The camera with its standard errors, as `read_camera` reads it.

    Raises:
        TaskcalError: the calibration was not made from images.
    """
    camera = Camera.of(calibration)
    K, names = camera.matrix, DISTORTION[camera.lens.model]
    content: dict[str, Any] = {
        "lens": camera.lens.model,
        "width": camera.lens.width,
        "height": camera.lens.height,
        "fx": float(K[0, 0]),
        "fy": float(K[1, 1]),
        "cx": float(K[0, 2]),
        "cy": float(K[1, 2]),
        "distortion": dict(zip(names, camera.distortion.tolist(), strict=True)),
        "u": dict(zip(("fx", "fy", "cx", "cy", *names), camera.error.tolist(), strict=True)),
    }
    return camera.exported(tomli_w.dumps({"camera": content}))


def export_camera_urdf(calibration: Calibration) -> Export:
    """The camera's optical frame as a link of a URDF, fixed to the robot's link of the tool, or of the base.

    Raises:
        TaskcalError: the calibration was not made from images.
    """
    camera = Camera.of(calibration)
    xyz = " ".join(repr(float(value)) for value in camera.T_parent_camera[:3, 3])
    rpy = " ".join(repr(float(np.radians(value))) for value in placed(camera.T_parent_camera)["rpy_deg"])
    parent = quoteattr(camera.parent)
    text = f"""<?xml version="1.0"?>
<robot name={quoteattr(f"{calibration.model.robot.name}-camera")}>
  <link name={parent}/>
  <link name="{OPTICAL}"/>
  <joint name={quoteattr(f"{camera.parent}-{OPTICAL}")} type="fixed">
    <origin xyz="{xyz}" rpy="{rpy}"/>
    <parent link={parent}/>
    <child link="{OPTICAL}"/>
  </joint>
</robot>
"""
    return camera.exported(text)


def _matrix(name: str, values: Float[np.ndarray, "n m"], tag: str = "", type: str = "") -> list[str]:
    data = ", ".join(repr(float(value)) for value in values.ravel())
    kind = [f"  dt: {type}"] if type else []
    return [f"{name}:{tag}", f"  rows: {values.shape[0]}", f"  cols: {values.shape[1]}", *kind, f"  data: [{data}]"]
