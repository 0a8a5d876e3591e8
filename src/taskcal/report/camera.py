"""What a fit of images says of camera, hand and eye: for machines, in words, and as a section of a report."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError
from taskcal.export.camera import Pictured
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.observations import Pixels, images_of
from taskcal.observations.camera import KILO, Lens, Pictures
from taskcal.reading.detection import thumbnail
from taskcal.report.chart import BLUE, VERMILION, Axis, Figure, Heatmap, Panel, Series
from taskcal.report.content import Chart, Column, Section, TextTable, WithMinus, decimals_of
from taskcal.robot.error_model import ErrorModel
from taskcal_groundwork.said import Said, joined, numeral, term

MAX_ARROWS = 2000
"""Residuals that one picture shows, evenly chosen among all: more cover each other."""

ARROWS_AT_ONCE = 500
"""Of a line, which is drawn as it is up to some thousand points."""

MAX_IMAGES = 8
"""That are shown one by one, those with the largest residuals."""

ARROW_SHARE = 0.04
"""Of the image's width that an arrow takes at most, those of the largest twentieth apart: about the distance of corners."""

ARROWS_NOTE = Said(
    "Each arrow goes from where a corner is predicted towards where it was seen, enlarged as stated. With the board of each image "
    "placed where it fits best, what is left is lens and noise: arrows that turn together, as in a ring or towards a corner, are "
    "of a lens that the model does not describe. With the board where the robot has it, the arrows of one image go the same way, "
    "and tell how far robot and board are off there. The worst images follow."
)

COVERED = 8, 6
"""Parts of the image plane, across and down, in which corners are counted."""


def describe_camera(calibration: Calibration, campaign: Campaign | None = None) -> dict[str, Any]:
    """Cameras, hand-eye, boards, and how far corners are from where they are predicted; empty without images.

    Args:
        calibration: of images.
        campaign: with images, the rows that were fitted or others; without, nothing is said of corners.
    """
    pictured = Pictured.of(calibration)
    if pictured is None:
        return {}
    kind, (values, errors) = pictured.kind, pictured.unknowns
    corners = {} if campaign is None else _describe_corners(pictured, campaign)
    cameras = {
        name: {
            "model": lens.model,
            "width": lens.width,
            "height": lens.height,
            **{number: KILO ** (number[0] in "fc") * values[f"{name}.{number}"] for number in lens.unknowns},
            "standard_error": {
                number: KILO ** (number[0] in "fc") * errors[f"{name}.{number}"] for number in lens.unknowns
            },
            **_placed(pictured, name),
            **corners.get("cameras", {}).get(name, {}),
        }
        for name, lens in zip(kind.cameras, kind.lenses, strict=True)
    }
    boards: dict[str, Any] = {}
    for name in kind.boards:
        scale = f"board {name}.scale"
        boards[name] = {
            **_placed(pictured, f"board {name}"),
            "scale_ppm": values[scale] * 1e6 if scale in values else None,
            "scale_standard_error_ppm": errors[scale] * 1e6 if scale in errors else None,
        }
    hand_eye = {key: value for key, value in _placed(pictured, kind.moving[0]).items() if key != "frame"}
    return {
        "camera": cameras[kind.cameras[0]],
        "hand_eye": {"on_wrist": kind.target, **hand_eye},
        "board": boards,
        **corners,
        "cameras": cameras,
    }


def _seen(pictured: Pictured, campaign: Campaign) -> tuple[Pixels, Float[np.ndarray, " u"]]:
    """What the images show, and the unknowns of the calibration in its order.

    Raises:
        CampaignError: they are of another camera, or there are none.
    """
    found, own = images_of(campaign.observations), pictured.kind
    if found is None or _who(found[1]) != _who(own):
        cameras = ", ".join(
            f"{name}: {lens.model}, {lens.width} × {lens.height} pixels, {'on the wrist' if moves else 'beside the robot'}"
            for name, lens, moves in zip(own.cameras, own.lenses, own.on_wrist, strict=True)
        )
        raise CampaignError(
            f"{campaign.source or 'the campaign'} does not show what the calibration has ({cameras}; on the wrist: "
            f"{', '.join(own.moving)}); name the campaign that was fitted, with its --images, --board and --lens"
        )
    layout, z = pictured.calibration.layout, pictured.calibration.z
    return found[1], found[1].named_like(own, layout.unknowns(z)[pictured.target])


def _who(kind: Pixels) -> tuple[dict[str, Lens], str, set[str]]:
    """Cameras and their lenses, and what is on the wrist, the target by its name."""
    return dict(zip(kind.cameras, kind.lenses, strict=True)), kind.target, set(kind.moving)


def _residuals(pictured: Pictured, campaign: Campaign) -> tuple[Float[np.ndarray, "c 2"], ...]:
    """Pixels of each camera's corners less those predicted for the boards where the robot has them."""
    kind, unknown = _seen(pictured, campaign)
    targets = pictured.calibration.target_poses(campaign.q, campaign.conditions)
    found = kind.reproject(targets[:, pictured.target], unknown)
    assert found is not None
    return found


def _describe_corners(pictured: Pictured, campaign: Campaign) -> dict[str, Any]:
    """How far corners are from where they are predicted, and the usual two steps."""
    kind, T = _seen(pictured, campaign)[0], pictured.calibration.T_tool_target[pictured.target]
    assert kind.pictures is not None
    poses = ErrorModel(pictured.calibration.model.robot).poses(campaign.q)
    X, by_steps = kind.two_steps(poses)
    nominal = poses @ X
    apart, residual = se3.inverse(T) @ X, _residuals(pictured, campaign)
    steps = kind.reproject(nominal, by_steps)
    assert steps is not None
    weights = [len(pictures.pixel) for pictures in kind.pictures]
    return {
        "reprojection_px": _rms(np.concatenate(residual)),
        "corner_noise_px": math.sqrt(np.average([one.noise**2 for one in kind.pictures], weights=weights)),
        "two_steps": {
            "reprojection_px": _rms(np.concatenate(steps)),
            "hand_eye": _placed_at(X),
            "apart_mm": float(np.linalg.norm(apart[:3, 3])) * 1e3,
            "apart_mrad": float(np.linalg.norm(se3.log(apart[:3, :3]))) * 1e3,
        },
        "cameras": {
            name: {
                "images": len(set(pictures.names)),
                "reprojection_px": _rms(r) if len(r) else None,
                "corner_noise_px": pictures.noise,
            }
            for name, pictures, r in zip(kind.cameras, kind.pictures, residual, strict=True)
        },
    }


def camera_facts(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The same in words; nothing without images."""
    if "cameras" not in result:
        return []
    hand_eye, steps, out = result["hand_eye"], result["two_steps"], list[tuple[str, str]]()
    for name, camera in result["cameras"].items():
        error = camera["standard_error"]
        out.append(
            (
                name,
                f"{camera['model']}, fx {camera['fx']:.1f} ± {error['fx']:.2g}, fy {camera['fy']:.1f} ± {error['fy']:.2g}, cx "
                f"{camera['cx']:.1f} ± {error['cx']:.2g}, cy {camera['cy']:.1f} ± {error['cy']:.2g} px (1σ)",
            )
        )
    places = {**result["cameras"], **{f"board {name}": board for name, board in result["board"].items()}}
    if len(places) > 2:
        for name, place in places.items():
            where = "on the wrist" if place["frame"] == "tool" else "stands"
            out.append((f"place of {name}", f"{where}, known to {_known_to(place)} (1σ, in space)"))
    return [
        *out,
        (
            "hand-eye",
            f"{hand_eye['on_wrist']} on the wrist, known to {_known_to(hand_eye)} (1σ, in space); "
            f"camera first, then hand-eye: {steps['apart_mm']:.2g} mm and {np.degrees(steps['apart_mrad'] / 1e3):.2g}° elsewhere",
        ),
        (
            "corners",
            f"{result['reprojection_px']:.2f} px rms from where the robot has them ({steps['reprojection_px']:.2f} px in two "
            f"steps); noise {result['corner_noise_px']:.2f} px (1σ, each direction)",
        ),
    ]


def _known_to(place: Mapping[str, Any]) -> str:
    """How well a place is known, in space."""
    mm, mrad = (float(np.linalg.norm(place[f"standard_error_{unit}"])) for unit in ("mm", "mrad"))
    return f"{mm:.2g} mm and {np.degrees(mrad / 1e3):.2g}°"


def _rms(residual: Float[np.ndarray, "c 2"]) -> float:
    return float(np.sqrt(np.nanmean((residual**2).sum(axis=1))))


def _placed_at(T: Float[np.ndarray, "4 4"]) -> dict[str, Any]:
    return {"position_mm": (T[:3, 3] * 1e3).tolist(), "quaternion": se3.to_quaternion(T[:3, :3]).tolist()}


def _placed(pictured: Pictured, name: str) -> dict[str, Any]:
    """Place of a camera or a board in the base, or in the tool frame, and the standard errors along and about its axes."""
    T, covariance = pictured.place(name)
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0)) * 1e3
    return {
        "frame": "base" if name in pictured.kind.standing else "tool",
        **_placed_at(T),
        "standard_error_mm": errors[:3].tolist(),
        "standard_error_mrad": errors[3:].tolist(),
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
    pictured = Pictured.of(calibration)
    if pictured is None:
        return None
    found = describe_camera(calibration, campaign)
    own = (
        *(_tabulate_camera(name, camera) for name, camera in found["cameras"].items()),
        _tabulate_hand_eye(found["hand_eye"]),
        _tabulate_places(found),
    )
    if campaign is None:
        return Section(
            Said("Camera and hand-eye"),
            *own,
            Said(
                "The corners are not kept in a calibration. Their residuals, the part of the image they cover, and what the usual "
                "two steps give, are shown by taskcal report CAL.json --campaign CAMPAIGN.csv --images FOLDER --board BOARD.toml, "
                "with the files that were fitted ({campaign}).",
                campaign=calibration.provenance.campaign,
            ),
        )
    kind, charts = _seen(pictured, campaign)[0], list[Chart]()
    assert kind.pictures is not None
    for name, pictures, residual in zip(kind.cameras, kind.pictures, _residuals(pictured, campaign), strict=True):
        if not len(residual):
            continue
        several, numbers = len(kind.cameras) > 1, np.array([found["cameras"][name][k] for k in pictures.lens.unknowns])
        folder = images / name.removeprefix("camera ") if several and images is not None else images
        coverage, share = _draw_coverage(pictures)
        titles = Said("Residuals of the corners over the image"), Said("Corners over the image")
        left, seen = (Said("{title} of {name}", title=one, name=name) for one in titles) if several else titles
        charts += [
            Chart(left, _draw_arrows(pictures, residual, numbers, folder), ARROWS_NOTE),
            Chart(
                seen,
                coverage,
                Said(
                    "Corners were seen in {share:.0%} of {parts} parts. In empty ones the lens is extrapolated: let the board "
                    "reach them.",
                    share=share,
                    parts=math.prod(COVERED),
                ),
            ),
        ]
    return Section(Said("Camera and hand-eye"), *own, _tabulate_steps(found), *charts)


def _tabulate_camera(name: str, camera: Mapping[str, Any]) -> TextTable:
    """The camera's numbers and their standard errors."""
    errors: Mapping[str, float] = camera["standard_error"]
    rows: list[tuple[str, ...]] = [
        (number, *_stated(camera[number], error), "px" if number in ("fx", "fy", "cx", "cy") else "")
        for number, error in errors.items()
    ]
    return TextTable.of_rows(
        Said(
            "{name}: {model}, {width} × {height} pixels",
            name=name.capitalize(),
            model=term(camera["model"]),
            width=camera["width"],
            height=camera["height"],
        ),
        (Said("number"), Said("value"), "1σ", Said("unit")),
        rows,
        text_columns=(0, 3),
        note=Said("As OpenCV defines them; the middle of the first pixel is 0, 0."),
    )


def _tabulate_places(found: Mapping[str, Any]) -> TextTable:
    """Where each camera and each board is, and how large a board is."""
    rows: list[dict[str, Any]] = []
    boards = ((Said("board {name}", name=name), one) for name, one in found["board"].items())
    for name, one in (*found["cameras"].items(), *boards):
        mm, mrad = (float(np.linalg.norm(one[f"standard_error_{unit}"])) for unit in ("mm", "mrad"))
        rows.append(
            {
                "name": name,
                "frame": one["frame"],
                **dict(zip("xyz", one["position_mm"], strict=True)),
                "mm": mm,
                "degrees": math.degrees(mrad / 1e3),
                "scale": one.get("scale_ppm"),
                "scale_error": one.get("scale_standard_error_ppm"),
            }
        )
    columns = (
        Column("", "name"),
        Column(Said("in the frame of the"), lambda one: term(one["frame"])),
        *(Column(f"{axis} mm", axis, ".2f") for axis in "xyz"),
        Column("1σ mm", "mm", ".3f"),
        Column("1σ °", "degrees", ".3f"),
        Column(Said("larger than stated ppm"), "scale", ".0f"),
        Column(Said("1σ ppm"), "scale_error", ".0f"),
    )
    return TextTable.of(
        Said("Where cameras and boards are"),
        columns,
        rows,
        note=Said(
            "Errors are in space, of the place and of the turn. The origin of a board is the outer corner of its first square."
        ),
    )


def _tabulate_hand_eye(hand_eye: Mapping[str, Any]) -> TextTable:
    """Place and turn of what is on the wrist, in the tool frame, millimetres and degrees."""
    mm = zip("xyz", hand_eye["position_mm"], hand_eye["standard_error_mm"], strict=True)
    degrees = zip("xyz", np.degrees(np.array(hand_eye["standard_error_mrad"]) / 1e3), strict=True)
    rows: list[tuple[str, ...]] = [(axis, *_stated(value, error), "mm") for axis, value, error in mm]
    rows += [
        (Said("turn about {axis}", axis=axis), "–", numeral(error, f".{decimals_of(error)}f"), "°")
        for axis, error in degrees
    ]
    return TextTable.of_rows(
        Said("Hand-eye: the {on_wrist} in the tool frame", on_wrist=hand_eye["on_wrist"]),
        (Said("number"), Said("value"), "1σ", Said("unit")),
        rows,
        text_columns=(0, 3),
        note=Said(
            "Its orientation, as quaternion qx qy qz qw: {quaternion}. Turns are about the axes of the tool frame. z of a camera "
            "is its line of sight; x points to the right in the image, y down.",
            quaternion=joined(" ", (numeral(value, ".6f") for value in hand_eye["quaternion"])),
        ),
    )


def _stated(value: float, error: float) -> tuple[Said, Said]:
    form = f".{decimals_of(error)}f"
    return numeral(WithMinus(value), form), numeral(error, form)


def _tabulate_steps(found: Mapping[str, Any]) -> TextTable:
    """The fit beside the usual two steps."""
    steps = found["two_steps"]
    rows = [
        {"method": Said("all in one fit"), "px": found["reprojection_px"]},
        {
            "method": Said("camera first, then hand-eye, nominal robot"),
            "px": steps["reprojection_px"],
            "mm": steps["apart_mm"],
            "degrees": math.degrees(steps["apart_mrad"] / 1e3),
        },
    ]
    columns = (
        Column(Said("method"), "method"),
        Column(Said("corners px rms"), "px", ".2f"),
        Column(Said("hand-eye apart mm"), "mm", ".3f"),
        Column(Said("apart °"), "degrees", ".3f"),
    )
    return TextTable.of(
        Said("The usual two steps on the same images"),
        columns,
        rows,
        note=Said(
            "Corners: seen less predicted, with the board where the robot has it; their noise is {noise:.2f} px (1σ, each "
            "direction).",
            noise=found["corner_noise_px"],
        ),
    )


def _draw_arrows(
    pictures: Pictures, residual: Float[np.ndarray, "c 2"], camera: Float[np.ndarray, " k"], images: Path | None
) -> Mapping[str, Figure]:
    """Residuals over the image plane: of all images, then of those with the largest ones, over these."""
    robot = Said("board where the robot has it")
    numbers = camera / np.repeat([KILO, 1.0], [4, len(camera) - 4])
    alone = pictures.residual(pictures.settle(numbers), numbers)
    every = np.arange(0, len(residual), math.ceil(len(residual) / MAX_ARROWS))
    panels = (
        _arrows(pictures, every, residual, VERMILION, robot),
        _arrows(pictures, every, alone, BLUE, Said("board where it fits best")),
    )
    views: dict[str, Figure] = {Said("all images"): Figure(panels=panels, columns=2)}
    name_of = np.array(pictures.names, dtype=object)[pictures.of]
    each = {name: np.flatnonzero(name_of == name) for name in dict.fromkeys(pictures.names)}
    sizes = {name: _rms(residual[own]) for name, own in each.items()}
    for name in sorted(sizes, key=lambda one: -sizes[one])[:MAX_IMAGES]:
        own = each[name][:MAX_ARROWS]
        views[Said("{name}, {size:.2f} px rms", name=name, size=sizes[name])] = Figure(
            panels=(_arrows(pictures, own, residual, VERMILION, robot, _shown(images, name)),)
        )
    return views


def _shown(images: Path | None, name: str) -> bytes:
    """An image of a folder, small; nothing where it is not there."""
    path = None if images is None else images / Path(name).name
    return thumbnail(path) if path is not None and path.is_file() else b""


def _arrows(
    pictures: Pictures,
    corners: np.ndarray,
    residual: Float[np.ndarray, "c 2"],
    colour: str,
    what: str,
    image: bytes = b"",
) -> Panel:
    """Arrows of some corners, enlarged by the largest of 1, 2, 5, 10 … with which they have room."""
    lens, seen, r = pictures.lens, pictures.pixel[corners], residual[corners]
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
        title=Said("{what}: {size:.2f} px rms, arrows × {times:g}", what=what, size=_rms(r), times=times),
        x=Axis(title="u", unit="px", span=(0.0, float(lens.width))),
        y=Axis(title="v", unit="px", span=(float(lens.height), 0.0)),
        series=tuple(
            Series(kind="line", x=part[..., 0].ravel(), y=part[..., 1].ravel(), colour=colour) for part in parts
        ),
        image=image,
        equal=True,
    )


def _draw_coverage(pictures: Pictures) -> tuple[Figure, float]:
    """How many corners were seen in each part of the image plane, and in which share of the parts any."""
    lens, (u, v) = pictures.lens, pictures.pixel.T
    counts, across, down = np.histogram2d(u, v, bins=COVERED, range=((0.0, lens.width), (0.0, lens.height)))
    middles = [0.5 * (edges[1:] + edges[:-1]) for edges in (across, down)]
    panel = Panel(
        x=Axis(title="u", unit="px", span=(0.0, float(lens.width))),
        y=Axis(title="v", unit="px", span=(float(lens.height), 0.0)),
        cells=Heatmap(x=middles[0], y=middles[1], z=np.where(counts > 0, counts, np.nan).T),
        equal=True,
    )
    return Figure(panels=(panel,), scale=(0.0, float(counts.max()), Said("corners"))), float((counts > 0).mean())
