"""What a fit of images says of camera, hand and eye: for machines, in words, and as a section of a report."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.observations import Pixels
from taskcal.observations.camera import KILO
from taskcal.reading.detection import thumbnail
from taskcal.report.chart import BLUE, VERMILION, Axis, Cells, Figure, Panel, Series
from taskcal.report.content import Chart, Column, Section, Table, decimals_of
from taskcal.robot.error_model import ErrorModel

MAX_ARROWS = 2000
"""Residuals that one picture shows, evenly chosen among all: more cover each other."""

ARROWS_AT_ONCE = 500
"""Of a line, which is drawn as it is up to some thousand points."""

MAX_IMAGES = 8
"""That are shown one by one, those with the largest residuals."""

ARROW_SHARE = 0.04
"""Of the image's width that an arrow takes at most, those of the largest twentieth apart: about the distance of corners."""

COVERED = 8, 6
"""Parts of the image plane, across and down, in which corners are counted."""


def describe_camera(calibration: Calibration, campaign: Campaign | None = None) -> dict[str, Any]:
    """Camera, hand-eye, boards, and how far corners are from where they are predicted; empty without images.

    Args:
        calibration: of images.
        campaign: with images, the rows that were fitted or others; without, nothing is said of corners.
    """
    layout, deviation = calibration.layout, np.sqrt(np.maximum(np.diag(calibration.z_covariance), 0.0))
    t = _pictured(calibration)
    if t is None:
        return {}
    kind, unknown, error = layout.kinds[t], layout.unknowns(calibration.z)[t], deviation[layout.own[t]]
    assert isinstance(kind, Pixels)
    assert kind.lens is not None
    known = dict(zip(kind.unknowns, zip(unknown, error, strict=True), strict=True))
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
    places = layout.places[t]
    own = calibration.z_covariance[np.ix_(places, places)]  # in the axes of what is on the wrist
    mm, mrad = (_in_axes(T[:3, :3], block) * 1e3 for block in (own[:3, :3], own[3:, 3:]))
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
            "standard_error_mm": mm.tolist(),
            "standard_error_mrad": mrad.tolist(),
        },
        "board": boards,
        **({} if campaign is None else _describe_corners(calibration, campaign, t)),
    }


def _pictured(calibration: Calibration) -> int | None:
    """Number of the target that images show; None without images."""
    kinds = () if calibration.layout.fixed_frames else calibration.layout.kinds
    return next((t for t, kind in enumerate(kinds) if isinstance(kind, Pixels) and kind.lens is not None), None)


def _seen(calibration: Calibration, campaign: Campaign, t: int) -> tuple[Pixels, Float[np.ndarray, " u"]]:
    """What the images show, and the unknowns of the calibration in its order.

    Raises:
        CampaignError: they are of another camera, or there are none.
    """
    layout, found = calibration.layout, campaign.observations
    kind, own = found[t] if len(found) == len(layout.kinds) else None, layout.kinds[t]
    assert isinstance(own, Pixels)
    assert own.lens is not None
    if not isinstance(kind, Pixels) or (kind.lens, kind.on_wrist) != (own.lens, own.on_wrist):
        raise CampaignError(
            f"{campaign.source or 'the campaign'} does not show the calibration's camera ({own.lens.model}, {own.lens.width} × "
            f"{own.lens.height} pixels, {'on the wrist' if own.on_wrist else 'beside the robot'}); name the campaign that was "
            "fitted, with its --images, --board and --lens"
        )
    return kind, kind.named_like(layout.kinds[t], layout.unknowns(calibration.z)[t])


def _residuals(calibration: Calibration, campaign: Campaign, t: int) -> Float[np.ndarray, "c 2"]:
    """Pixels of corners less those predicted for the board where the robot has it."""
    kind, unknown = _seen(calibration, campaign, t)
    found = kind.reproject(calibration.target_poses(campaign.q, campaign.conditions)[:, t], unknown)
    assert found is not None
    return found


def _describe_corners(calibration: Calibration, campaign: Campaign, t: int) -> dict[str, Any]:
    """How far corners are from where they are predicted, and the usual two steps."""
    kind, T = _seen(calibration, campaign, t)[0], calibration.T_tool_target[t]
    assert kind.pictures is not None
    X, by_steps = kind.two_steps(ErrorModel(calibration.model.robot).poses(campaign.q))
    nominal = ErrorModel(calibration.model.robot).poses(campaign.q) @ X
    apart = se3.inverse(T) @ X
    return {
        "reprojection_px": _rms(_residuals(calibration, campaign, t)),
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


def _in_axes(R: Float[np.ndarray, "3 3"], covariance: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, " 3"]:
    """Standard deviations of a turned vector."""
    return np.sqrt(np.maximum(np.diag(R @ covariance @ R.T), 0.0))


def _placed_at(T: Float[np.ndarray, "4 4"]) -> dict[str, list[float]]:
    return {"position_mm": (T[:3, 3] * 1e3).tolist(), "quaternion": se3.to_quaternion(T[:3, :3]).tolist()}


def _placed(numbers: list[tuple[float, float]]) -> dict[str, list[float]]:
    values, errors = np.array(numbers).T
    return {
        **_placed_at(se3.pose(se3.exp(values[3:]), values[:3])),
        "standard_error_mm": (errors[:3] * 1e3).tolist(),
        "standard_error_mrad": (errors[3:] * 1e3).tolist(),
    }


# A section of the report of a calibration.


def camera_section(
    calibration: Calibration, campaign: Campaign | None = None, images: Path | None = None
) -> Section | None:
    """Make the section of camera and hand-eye; None without images.

    Args:
        calibration: of images or not.
        campaign: with images, whose corners are drawn.
        images: their folder, from which some are shown, small.

    Raises:
        FileError: an image is not one that OpenCV reads.
    """
    t = _pictured(calibration)
    if t is None:
        return None
    found = describe_camera(calibration, campaign)
    own = _tabulate_camera(found["camera"]), _tabulate_hand_eye(found["hand_eye"])
    if campaign is None:
        return Section(
            "Camera and hand-eye",
            *own,
            "The corners are not kept in a calibration. Their residuals, the part of the image they cover, and what the usual two "
            "steps give, are shown by taskcal report CAL.json --campaign CAMPAIGN.csv --images FOLDER --board BOARD.toml, with the "
            f"files that were fitted ({calibration.provenance.campaign}).",
        )
    kind = _seen(calibration, campaign, t)[0]
    camera = np.array([found["camera"][name] for name in kind.lens.unknowns]) if kind.lens else np.zeros(0)
    coverage, share = _draw_coverage(kind)
    return Section(
        "Camera and hand-eye",
        *own,
        _tabulate_steps(found),
        Chart(
            "Residuals of the corners over the image",
            _draw_arrows(kind, _residuals(calibration, campaign, t), camera, images),
            "Each arrow goes from where a corner is predicted towards where it was seen, enlarged as stated. With the board of "
            "each image placed where it fits best, what is left is lens and noise: arrows that turn together, as in a ring or "
            "towards a corner, are of a lens that the model does not describe. With the board where the robot has it, the arrows "
            "of one image go the same way, and tell how far robot and board are off there. The worst images follow.",
        ),
        Chart(
            "Corners over the image",
            coverage,
            f"Corners were seen in {share:.0%} of {math.prod(COVERED)} parts. In empty ones the lens is extrapolated: let the "
            "board reach them.",
        ),
    )


def _tabulate_camera(camera: Mapping[str, Any]) -> Table:
    """The camera's numbers and their standard errors."""
    errors: Mapping[str, float] = camera["standard_error"]
    rows = [
        (name, *_stated(camera[name], error), "px" if name in ("fx", "fy", "cx", "cy") else "")
        for name, error in errors.items()
    ]
    return Table.of_rows(
        f"Camera: {camera['model']}, {camera['width']} × {camera['height']} pixels",
        ("number", "value", "1σ", "unit"),
        rows,
        text_columns=(0, 3),
        note="As OpenCV defines them; the middle of the first pixel is 0, 0.",
    )


def _tabulate_hand_eye(hand_eye: Mapping[str, Any]) -> Table:
    """Place and turn of what is on the wrist, in the tool frame, millimetres and degrees."""
    mm = zip("xyz", hand_eye["position_mm"], hand_eye["standard_error_mm"], strict=True)
    degrees = zip("xyz", np.degrees(np.array(hand_eye["standard_error_mrad"]) / 1e3), strict=True)
    rows = [(axis, *_stated(value, error), "mm") for axis, value, error in mm]
    rows += [(f"turn about {axis}", "–", f"{error:.{decimals_of(error)}f}", "°") for axis, error in degrees]
    quaternion = " ".join(f"{value:.6f}" for value in hand_eye["quaternion"])
    return Table.of_rows(
        f"Hand-eye: the {hand_eye['on_wrist']} in the tool frame",
        ("number", "value", "1σ", "unit"),
        rows,
        text_columns=(0, 3),
        note=f"Its orientation, as quaternion qx qy qz qw: {quaternion}. Turns are about the axes of the tool frame. "
        "z of a camera is its line of sight; x points to the right in the image, y down.",
    )


def _stated(value: float, error: float) -> tuple[str, str]:
    digits = decimals_of(error)
    return f"{value:.{digits}f}".replace("-", "−"), f"{error:.{digits}f}"


def _tabulate_steps(found: Mapping[str, Any]) -> Table:
    """The fit beside the usual two steps."""
    steps = found["two_steps"]
    rows = [
        {"method": "all in one fit", "px": found["reprojection_px"]},
        {
            "method": "camera first, then hand-eye, nominal robot",
            "px": steps["reprojection_px"],
            "mm": steps["apart_mm"],
            "degrees": math.degrees(steps["apart_mrad"] / 1e3),
        },
    ]
    columns = (
        Column("method", "method"),
        Column("corners px rms", "px", ".2f"),
        Column("hand-eye apart mm", "mm", ".3f"),
        Column("apart °", "degrees", ".3f"),
    )
    return Table.of(
        "The usual two steps on the same images",
        columns,
        rows,
        note=f"Corners: seen less predicted, with the board where the robot has it; their noise is {found['corner_noise_px']:.2f} "
        "px (1σ, each direction).",
    )


def _draw_arrows(
    kind: Pixels, residual: Float[np.ndarray, "c 2"], camera: Float[np.ndarray, " k"], images: Path | None
) -> Mapping[str, Figure]:
    """Residuals over the image plane: of all images, then of those with the largest ones, over these."""
    assert kind.pictures is not None
    pictures, robot = kind.pictures, "board where the robot has it"
    numbers = camera / np.repeat([KILO, 1.0], [4, len(camera) - 4])
    alone = pictures.residual(pictures.settle(numbers), numbers)
    every = np.arange(0, len(residual), math.ceil(len(residual) / MAX_ARROWS))
    panels = (
        _arrows(kind, every, residual, VERMILION, robot),
        _arrows(kind, every, alone, BLUE, "board where it fits best"),
    )
    views = {"all images": Figure(panels=panels, columns=2)}
    each = [np.flatnonzero(pictures.of == k) for k in range(len(pictures))]
    sizes = np.array([_rms(residual[own]) for own in each])
    for k in np.argsort(-sizes)[:MAX_IMAGES].tolist():
        own = each[k]
        views[f"{pictures.names[k]}, {sizes[k]:.2f} px rms"] = Figure(
            panels=(_arrows(kind, own[:MAX_ARROWS], residual, VERMILION, robot, _shown(images, pictures.names[k])),)
        )
    return views


def _shown(images: Path | None, name: str) -> bytes:
    """An image of a folder, small; nothing where it is not there."""
    path = None if images is None else images / Path(name).name
    return thumbnail(path) if path is not None and path.is_file() else b""


def _arrows(
    kind: Pixels, corners: np.ndarray, residual: Float[np.ndarray, "c 2"], colour: str, what: str, image: bytes = b""
) -> Panel:
    """Arrows of some corners, enlarged by the largest of 1, 2, 5, 10 … with which they have room."""
    assert kind.pictures is not None
    lens, seen, r = kind.pictures.lens, kind.pictures.pixel[corners], residual[corners]
    usual = max(float(np.nanpercentile(np.linalg.norm(r, axis=1), 95)), 1e-9)
    room = ARROW_SHARE * lens.width / usual
    decade = 10.0 ** math.floor(math.log10(room))
    times = max(m * decade for m in (1, 2, 5) if m * decade <= room)
    tail = seen - r
    tip, back = tail + times * r, -0.25 * times * r
    across = back[:, ::-1] * np.array([0.5, -0.5])
    gap = np.full_like(tip, np.nan)
    strokes = np.stack([tail, tip, gap, tip + back + across, tip, tip + back - across, gap], axis=1)
    parts = np.array_split(strokes, math.ceil(len(strokes) / ARROWS_AT_ONCE))
    return Panel(
        title=f"{what}: {_rms(r):.2f} px rms, arrows × {times:g}",
        x=Axis(title="u", unit="px", span=(0.0, float(lens.width))),
        y=Axis(title="v", unit="px", span=(float(lens.height), 0.0)),
        series=tuple(
            Series(kind="line", x=part[..., 0].ravel(), y=part[..., 1].ravel(), colour=colour) for part in parts
        ),
        image=image,
        equal=True,
    )


def _draw_coverage(kind: Pixels) -> tuple[Figure, float]:
    """How many corners were seen in each part of the image plane, and in which share of the parts any."""
    assert kind.pictures is not None
    lens, (u, v) = kind.pictures.lens, kind.pictures.pixel.T
    counts, across, down = np.histogram2d(u, v, bins=COVERED, range=((0.0, lens.width), (0.0, lens.height)))
    middles = [0.5 * (edges[1:] + edges[:-1]) for edges in (across, down)]
    panel = Panel(
        x=Axis(title="u", unit="px", span=(0.0, float(lens.width))),
        y=Axis(title="v", unit="px", span=(float(lens.height), 0.0)),
        cells=Cells(x=middles[0], y=middles[1], z=np.where(counts > 0, counts, np.nan).T),
        equal=True,
    )
    return Figure(panels=(panel,), scale=(0.0, float(counts.max()), "corners")), float((counts > 0).mean())
