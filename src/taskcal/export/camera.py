"""The camera of a calibration from images, and where it is, for ROS and OpenCV."""

import re
from dataclasses import dataclass
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
import tomli_w
from jaxtyping import Float

from taskcal.errors import TaskcalError, UnknownName
from taskcal.export.descriptions import links_of
from taskcal.export.forms import Export, Loss, placed
from taskcal.identification.calibration import Calibration
from taskcal.observations import Pixels, images_of
from taskcal.observations.camera import DISTORTION, KILO, Lens
from taskcal.observations.views import Posed

ROS_MODELS = {"pinhole": "plumb_bob", "fisheye": "equidistant"}
"""Distortion models of ``sensor_msgs/CameraInfo`` with the coefficients of each lens, in OpenCV's order."""


class Pictured(NamedTuple):
    """The target of a calibration that images show, or from which they were taken."""

    calibration: Calibration
    target: int
    """Its number."""
    kind: Pixels
    """What the images show."""

    @classmethod
    def of(cls, calibration: Calibration) -> "Pictured | None":
        """That of a calibration; None without images."""
        found = images_of(calibration.layout.kinds)
        if found is None or not found[1].lenses or calibration.layout.own[found[0]].held:
            return None
        return cls(calibration, *found)

    @property
    def unknowns(self) -> tuple[dict[str, float], dict[str, float]]:
        """What is unknown of the images, and its standard errors, by their names, metres, radians and thousands."""
        own = self.calibration.layout.own[self.target]
        deviation = np.sqrt(np.maximum(np.diag(self.calibration.z_covariance), 0.0))[own.columns]
        values, errors = (
            dict(zip(self.kind.unknowns, numbers.tolist(), strict=True))
            for numbers in (own.of(self.calibration.z), deviation)
        )
        return values, errors

    def place(self, name: str) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "6 6"]]:
        """Place of a camera or a board, in the base if it stands, else in the tool frame, and the covariance of a move and a turn.

        Args:
            name: one of `Pixels.bodies`.
        """
        calibration, T = self.calibration, self.calibration.T_tool_target[self.target]
        by = np.zeros((1, 6, len(calibration.z)))
        place, own = calibration.layout.places[self.target].columns, calibration.layout.own[self.target]
        by[0, :3, place[:3]] = by[0, 3:, place[3:]] = T[:3, :3].T
        at = self.kind.place_on_robot(name, Posed(T[None], by), own.of(calibration.z), own.columns)
        return at.T[0], at.by[0] @ calibration.z_covariance @ at.by[0].T


EXACT = Loss(rms=0.0, maximum=0.0, poses=0, reasons=())


@dataclass(frozen=True, eq=False, kw_only=True)
class Camera:
    """A camera that was found."""

    name: str
    """``camera``, or ``camera left`` of several."""
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
    def each(cls, calibration: Calibration) -> "dict[str, Camera]":
        """The cameras of a calibration, by their names; none where it was not made from images."""
        pictured, robot, out = Pictured.of(calibration), calibration.model.robot, dict[str, Camera]()
        if pictured is None:
            return out
        kind, (values, errors) = pictured.kind, pictured.unknowns
        for name, lens, on_wrist in zip(kind.cameras, kind.lenses, kind.on_wrist, strict=True):
            fx, fy, cx, cy = (float(values[f"{name}.{number}"]) * KILO for number in ("fx", "fy", "cx", "cy"))
            out[name] = cls(
                name=name,
                lens=lens,
                matrix=np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
                distortion=np.array([values[f"{name}.{number}"] for number in DISTORTION[lens.model]]),
                error=np.array([errors[f"{name}.{number}"] * KILO ** (number[0] in "fc") for number in lens.unknowns]),
                parent=links_of(robot)[on_wrist],
                on_wrist=on_wrist,
                T_parent_camera=pictured.place(name)[0],
            )
        return out

    @classmethod
    def of(cls, calibration: Calibration, name: str | None = None) -> "Camera":
        """A camera of a calibration.

        Args:
            calibration: from images.
            name: of the camera, as its folder was called; needed where there are several.

        Raises:
            TaskcalError: it was not made from images, or has several cameras and none is named.
            UnknownName: it has no camera of this name.
        """
        found = cls.each(calibration)
        if not found:
            raise TaskcalError(
                "this calibration has no camera: it was not made from images (taskcal identify --images)"
            )
        names = {one.removeprefix("camera").strip(): camera for one, camera in found.items()}
        if name is None and len(found) > 1:
            raise TaskcalError(f"this calibration has the cameras {', '.join(names)}: name one (--camera)")
        if name is not None and name not in names:
            raise UnknownName("camera", name, [one for one in names if one])
        return next(iter(found.values())) if name is None else names[name]

    @property
    def link(self) -> str:
        """Link of its optical frame: x to the right and y down in the image, z forward (REP 103)."""
        return f"{re.sub(r'[^A-Za-z0-9]+', '_', self.name)}_optical_frame"

    def exported(self, text: str) -> Export:
        """A file with this camera, and its pose beside."""
        where = f"{self.name} in the {'tool' if self.on_wrist else 'base'}"
        return Export(text=text, loss=EXACT, frames={where: self.T_parent_camera})


def export_camera_info(calibration: Calibration, name: str | None = None) -> Export:
    """The camera as ROS keeps it (``camera_info``, of camera_calibration_parsers).

    Raises:
        TaskcalError: the calibration was not made from images, or has several cameras and none is named.
    """
    camera = Camera.of(calibration, name)
    K, D = camera.matrix, camera.distortion
    lines = [
        f"image_width: {camera.lens.width}",
        f"image_height: {camera.lens.height}",
        f"camera_name: {re.sub(r'[^A-Za-z0-9]+', '_', camera.name)}",
        *_matrix("camera_matrix", K),
        f"distortion_model: {ROS_MODELS[camera.lens.model]}",
        *_matrix("distortion_coefficients", D[None]),
        *_matrix("rectification_matrix", np.eye(3)),
        *_matrix("projection_matrix", np.column_stack([K, np.zeros(3)])),
    ]
    return camera.exported("\n".join(lines) + "\n")


def export_opencv_yaml(calibration: Calibration, name: str | None = None) -> Export:
    """The camera and its pose as OpenCV's FileStorage reads them.

    Raises:
        TaskcalError: the calibration was not made from images, or has several cameras and none is named.
    """
    camera = Camera.of(calibration, name)
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


def export_camera_toml(calibration: Calibration, name: str | None = None) -> Export:
    """The camera with its standard errors, as `read_camera` reads it.

    Raises:
        TaskcalError: the calibration was not made from images, or has several cameras and none is named.
    """
    camera = Camera.of(calibration, name)
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


def export_camera_urdf(calibration: Calibration, name: str | None = None) -> Export:
    """The camera's optical frame as a link of a URDF, fixed to the robot's link of the tool, or of the base.

    Raises:
        TaskcalError: the calibration was not made from images, or has several cameras and none is named.
    """
    camera = Camera.of(calibration, name)
    xyz = " ".join(repr(float(value)) for value in camera.T_parent_camera[:3, 3])
    rpy = " ".join(repr(float(np.radians(value))) for value in placed(camera.T_parent_camera)["rpy_deg"])
    parent = quoteattr(camera.parent)
    text = f"""<?xml version="1.0"?>
<robot name={quoteattr(f"{calibration.model.robot.name}-camera")}>
  <link name={parent}/>
  <link name="{camera.link}"/>
  <joint name={quoteattr(f"{camera.parent}-{camera.link}")} type="fixed">
    <origin xyz="{xyz}" rpy="{rpy}"/>
    <parent link={parent}/>
    <child link="{camera.link}"/>
  </joint>
</robot>
"""
    return camera.exported(text)


def _matrix(name: str, values: Float[np.ndarray, "n m"], tag: str = "", type: str = "") -> list[str]:
    data = ", ".join(repr(float(value)) for value in values.ravel())
    kind = [f"  dt: {type}"] if type else []
    return [f"{name}:{tag}", f"  rows: {values.shape[0]}", f"  cols: {values.shape[1]}", *kind, f"  data: [{data}]"]
