"""What a fit of images says of camera, hand and eye: for machines, and in words."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.campaigns.campaign import Campaign
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.observations import Pixels
from taskcal.observations.camera import KILO
from taskcal.robot.error_model import ErrorModel


def describe_camera(calibration: Calibration, campaign: Campaign) -> dict[str, Any]:
    """Camera, hand-eye, boards, and how far corners are from where they are predicted; empty without images.

    Args:
        calibration: of the campaign.
        campaign: the rows that were fitted.
    """
    layout, deviation = calibration.layout, np.sqrt(np.maximum(np.diag(calibration.z_covariance), 0.0))
    pictured = [
        t for t, kind in enumerate(campaign.observations) if isinstance(kind, Pixels) and kind.pictures is not None
    ]
    if not pictured or layout.fixed_frames:
        return {}
    t = pictured[0]
    kind, unknown, error = campaign.observations[t], layout.unknowns(calibration.z)[t], deviation[layout.own[t]]
    assert isinstance(kind, Pixels)
    assert kind.pictures is not None
    assert kind.lens is not None
    known = dict(zip(layout.kinds[t].unknowns, zip(unknown, error, strict=True), strict=True))
    unknown = kind.named_like(layout.kinds[t], unknown)
    poses = calibration.target_poses(campaign.q, campaign.conditions)[:, t]
    T = calibration.T_tool_target[t]
    standing = {
        name: _placed([known[f"{name}.{c}"] for c in ("tx", "ty", "tz", "rx", "ry", "rz")]) for name in kind.standing
    }
    numbers = {name: [KILO ** (name[0] in "fc") * v for v in known[f"camera.{name}"]] for name in kind.lens.unknowns}
    boards: dict[str, Any] = {}
    for name in kind.boards:
        scale = known.get(f"board {name}.scale")
        boards[name] = {
            **standing.get(f"board {name}", {}),
            "scale_ppm": None if scale is None else scale[0] * 1e6,
            "scale_standard_error_ppm": None if scale is None else scale[1] * 1e6,
        }
    X, by_steps = kind.two_steps(ErrorModel(calibration.model.robot).poses(campaign.q))
    nominal = ErrorModel(calibration.model.robot).poses(campaign.q) @ X
    apart = se3.inverse(T) @ X
    own = deviation[layout.places[t]]
    return {
        "camera": {
            "model": kind.lens.model,
            "width": kind.lens.width,
            "height": kind.lens.height,
            **{name: value for name, (value, _) in numbers.items()},
            "standard_error": {name: deviation for name, (_, deviation) in numbers.items()},
            **standing.get("camera", {}),
        },
        "hand_eye": {
            "on_wrist": "camera" if kind.on_wrist else "board",
            **_placed_at(T),
            "standard_error_mm": (own[:3] * 1e3).tolist(),
            "standard_error_mrad": (own[3:] * 1e3).tolist(),
        },
        "board": boards,
        "reprojection_px": _rms(kind.reproject(poses, unknown)),
        "corner_noise_px": kind.pictures.noise,
        "two_steps": {
            "reprojection_px": _rms(kind.reproject(nominal, by_steps)),
            "hand_eye": _placed_at(X),
            "apart_mm": float(np.linalg.norm(apart[:3, 3])) * 1e3,
            "apart_mrad": float(np.linalg.norm(se3.log(apart[:3, :3]))) * 1e3,
        },
    }


def camera_facts(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The same in words; nothing without images."""
    if "camera" not in result:
        return []
    camera, hand_eye, steps = result["camera"], result["hand_eye"], result["two_steps"]
    error = camera["standard_error"]
    mm, mrad = (float(np.linalg.norm(hand_eye[f"standard_error_{unit}"])) for unit in ("mm", "mrad"))
    return [
        (
            "camera",
            f"{camera['model']}, fx {camera['fx']:.1f} ± {error['fx']:.2g}, fy {camera['fy']:.1f} ± {error['fy']:.2g}, cx "
            f"{camera['cx']:.1f} ± {error['cx']:.2g}, cy {camera['cy']:.1f} ± {error['cy']:.2g} px (1σ)",
        ),
        (
            "hand-eye",
            f"{hand_eye['on_wrist']} on the wrist, known to {mm:.2g} mm and {np.degrees(mrad / 1e3):.2g}° (1σ, in space); "
            f"camera first, then hand-eye: {steps['apart_mm']:.2g} mm and {np.degrees(steps['apart_mrad'] / 1e3):.2g}° elsewhere",
        ),
        (
            "corners",
            f"{result['reprojection_px']:.2f} px rms from where the robot has them ({steps['reprojection_px']:.2f} px in two "
            f"steps); noise {result['corner_noise_px']:.2f} px (1σ, each direction)",
        ),
    ]


def _rms(residual: Float[np.ndarray, "c 2"] | None) -> float:
    assert residual is not None
    return float(np.sqrt(np.nanmean((residual**2).sum(axis=1))))


def _placed_at(T: Float[np.ndarray, "4 4"]) -> dict[str, list[float]]:
    return {"position_mm": (T[:3, 3] * 1e3).tolist(), "quaternion": se3.to_quaternion(T[:3, :3]).tolist()}


def _placed(numbers: list[tuple[float, float]]) -> dict[str, list[float]]:
    values, errors = np.array(numbers).T
    return {
        **_placed_at(se3.pose(se3.exp(values[3:]), values[:3])),
        "standard_error_mm": (errors[:3] * 1e3).tolist(),
        "standard_error_mrad": (errors[3:] * 1e3).tolist(),
    }
