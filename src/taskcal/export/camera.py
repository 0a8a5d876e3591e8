"""The camera of a calibration from images, and where it is, for ROS and OpenCV."""

from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
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
    parent: str
    """Link that it is fixed to: the robot's ``tool``, or ``base_link``."""
    T_parent_camera: Float[np.ndarray, "4 4"]
    """Metres."""

    @classmethod
    def of(cls, calibration: Calibration) -> "Camera":
        """The camera of a calibration.

        Raises:
            TaskcalError: it was not made from images.
        """
        layout = calibration.layout
        found = [t for t, kind in enumerate(layout.kinds) if isinstance(kind, Pixels)]
        if not found:
            raise TaskcalError(
                "this calibration has no camera: it was not made from images (taskcal identify --images)"
            )
        kind = layout.kinds[found[0]]
        assert isinstance(kind, Pixels)
        assert kind.lens is not None
        values = dict(zip(kind.unknowns, layout.unknowns(calibration.z)[found[0]], strict=True))
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
            parent="tool" if kind.on_wrist else "base_link",
            T_parent_camera=T,
        )

    def exported(self, text: str) -> Export:
        """A file with this camera, and its pose beside."""
        where = "camera in the tool" if self.parent == "tool" else "camera in the base"
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
        *_matrix(f"T_{camera.parent.removesuffix('_link')}_camera", camera.T_parent_camera, tag, type="d"),
    ]
    return camera.exported("\n".join(lines) + "\n")


def export_camera_urdf(calibration: Calibration) -> Export:
    """The camera's optical frame as a link of a URDF, fixed to the robot's ``tool`` or ``base_link``.

    Raises:
        TaskcalError: the calibration was not made from images.
    """
    camera = Camera.of(calibration)
    xyz = " ".join(repr(float(value)) for value in camera.T_parent_camera[:3, 3])
    rpy = " ".join(repr(float(np.radians(value))) for value in placed(camera.T_parent_camera)["rpy_deg"])
    text = f"""<?xml version="1.0"?>
<robot name={quoteattr(f"{calibration.model.robot.name}-camera")}>
  <link name="{camera.parent}"/>
  <link name="{OPTICAL}"/>
  <joint name="{camera.parent}-{OPTICAL}" type="fixed">
    <origin xyz="{xyz}" rpy="{rpy}"/>
    <parent link="{camera.parent}"/>
    <child link="{OPTICAL}"/>
  </joint>
</robot>
"""
    return camera.exported(text)


def _matrix(name: str, values: Float[np.ndarray, "n m"], tag: str = "", type: str = "") -> list[str]:
    data = ", ".join(repr(float(value)) for value in values.ravel())
    kind = [f"  dt: {type}"] if type else []
    return [f"{name}:{tag}", f"  rows: {values.shape[0]}", f"  cols: {values.shape[1]}", *kind, f"  data: [{data}]"]
