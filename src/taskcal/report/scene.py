"""Scenes in space: a calibrated robot at measured poses with its errors, and layers that several scenes share."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.validation import MeasuredErrors
from taskcal.report.chart import BLUE, PURPLE, VERMILION
from taskcal.report.content import Viewer
from taskcal.robot.mechanism import trace_skeleton
from taskcal.robot.robot import Robot
from taskcal.task.workspace import Workspace

INK = "#1f2933"


def to_mm(points: Float[np.ndarray, "k 3"]) -> list[list[float]]:
    """Millimetres, to a tenth."""
    return np.round(np.asarray(points) * 1e3, 1).tolist()


def spread_rows(count: int, most: int) -> np.ndarray:
    """Numbers of at most so many rows, spread evenly over all."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int)) if count else np.zeros(0, dtype=int)


def strokes(
    label: str, lines: Iterable[Float[np.ndarray, "k 3"]], colour: str, *, width: float = 2, dash: bool = False
) -> Mapping[str, Any]:
    """Lines through points, metres."""
    at = [to_mm(line) for line in lines]
    return {"kind": "strokes", "label": label, "colour": colour, "width": width, "dash": dash, "at": at}


def workspace_layer(space: Workspace) -> Mapping[str, Any]:
    """The edges of a workspace."""
    return strokes("workspace of the task", outline(space), PURPLE, width=2.2)


def coloured_points(
    label: str,
    points: Float[np.ndarray, "k 3"],
    values: Float[np.ndarray, " k"],
    span: tuple[float, float],
    tips: Sequence[str],
) -> Mapping[str, Any]:
    """Points from dark to bright by a value each.

    Args:
        label: of the layer, with what the colours mean.
        points: metres.
        values: of the points.
        span: values of the darkest and the brightest colour.
        tips: what is said of each point.
    """
    return {
        "kind": "points",
        "label": label,
        "size": 4,
        "at": to_mm(points),
        "values": np.round(values, 5).tolist(),
        "least": span[0],
        "most": span[1],
        "tips": list(tips),
    }


def outline(space: Workspace) -> list[Float[np.ndarray, "k 3"]]:
    """Edges of a workspace in the base, metres: strokes through their points."""
    if space.shape == "box":
        around = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) - 0.5
        posts = around[:4]
    else:
        angle = np.linspace(0.0, 2.0 * np.pi, 49)
        around = 0.5 * np.c_[np.cos(angle), np.sin(angle)]
        posts = around[:48:12]
    edges = [np.c_[around, np.full(len(around), side)] for side in (-0.5, 0.5)]
    edges += [np.array([[*post, -0.5], [*post, 0.5]]) for post in posts]
    return [se3.apply(space.T_base_frame, space.center + (edge * space.size) @ space.turned.T) for edge in edges]


MAX_POSES = 60
"""At which a page can show the robot."""

MAX_ARROWS = 400
"""Of each kind; of more points some are shown, spread evenly over the rows."""

LINK_RADIUS = 0.025
"""Radius at which the first link is drawn, over the robot's reach: thin, so that it hides little."""

MATERIALS: Mapping[str, str] = {"link": "#8291a0", "joint": "#5f6d7a", "loop": "#a8741a", "tool": "#c24e08"}
"""Colours of a robot's parts, each with a contrast of 3 to a white and to a dark ground (WCAG 2.2, 1.4.11)."""

ARROW = 0.06
"""Length at which the median error is drawn at first, over the robot's reach."""

AT_ORIGIN = 0.1
"""Of the origin of a measuring frame from the robot's base, over its reach, below which no tracker stands there."""

MAX_DISTANCE = 1.6
"""Of a tracker that is drawn where it is, over the robot's reach; the scene would shrink for one farther away."""


def robot_scene(calibration: Calibration, errors: MeasuredErrors, space: Workspace | None) -> Viewer:
    """Draw the robot at measured poses, the measured points and their errors.

    Args:
        calibration: the calibration.
        errors: before and after, at the rows that were fitted.
        space: the task's workspace, if there is one.
    """
    robot = calibration.model.robot
    rows = spread_rows(len(errors.q), MAX_POSES)
    names = [f"id {calibration.ids[row]}" for row in rows]
    after, before = errors.after[..., :3].reshape(-1, 3), errors.before[..., :3].reshape(-1, 3)
    seen = np.flatnonzero(np.isfinite(after[:, 0]))
    seen = seen[spread_rows(len(seen), MAX_ARROWS)]
    at = errors.points.reshape(-1, 3)[seen]
    targets = after.shape[0] // len(errors.q)
    tips = [
        f"id {calibration.ids[k // targets]}, {calibration.targets[k % targets]}: {_length(before[k]):.3f} mm nominal, "
        f"{_length(after[k]):.3f} mm calibrated"
        for k in seen
    ]

    def arrows(label: str, errors: Float[np.ndarray, "k 3"], colour: str, **line: float) -> Mapping[str, Any]:
        by = np.round(errors * 1e3, 5).tolist()
        return {"kind": "arrows", "label": label, "colour": colour, "dash": False, **line, "at": to_mm(at), "by": by}

    layers: list[Mapping[str, Any]] = [
        {"kind": "points", "label": "measured points", "colour": INK, "size": 2.2, "at": to_mm(at), "tips": tips},
        arrows("error, nominal (registered)", before[seen], VERMILION, width=1.3, dash=True),
        arrows("error, calibrated", after[seen], BLUE, width=2.4),
    ]
    if space is not None:
        layers.append(workspace_layer(space))
    layers.append(_tracker(calibration))
    typical = float(np.median(np.linalg.norm(before[seen], axis=1))) if len(seen) else 0.0
    return Viewer(
        title="Measured points and errors",
        poses=draw_robot(robot, errors.q[rows], names),
        look=robot_look(robot),
        layers=tuple(layers),
        shown=len(rows) // 2,
        scale=nice_scale(ARROW * robot.reach / typical) if typical > 0.0 else None,
        floor=True,
        note=_note(calibration, len(seen), int(np.isfinite(after[:, 0]).sum())),
    )


def _note(calibration: Calibration, shown: int, points: int) -> str:
    some = f" Arrows at {shown} of {points} points." if shown < points else ""
    loosely = (
        " Effects that depend on how a pose is reached are drawn as in the middle of their range."
        if calibration.model.conditioned
        else ""
    )
    return (
        "Dashed arrows: error of the nominal model; solid arrows: error of the calibrated one, both from the predicted to the "
        f"measured point and enlarged.{some} Links are drawn as straight lines of the robot's dimensions."
        f"{loosely}"
    )


def draw_robot(robot: Robot, q: Float[np.ndarray, "n joints"], names: Sequence[str]) -> tuple[Mapping[str, Any], ...]:
    """A robot's lines at some poses, as a scene takes them, millimetres.

    Args:
        robot: the robot.
        q: joint positions, radians.
        names: of the poses.
    """
    drawn = trace_skeleton(robot, q)
    return tuple(
        {
            "name": name,
            "links": [to_mm(_corners(link[k])) for link in drawn.links],
            "joints": [
                [to_mm(origin[None])[0], np.round(axis, 4).tolist()]
                for origin, axis in zip(drawn.origins[k], drawn.axes[k], strict=True)
            ],
            "loop": [to_mm(bar[k]) for bar in drawn.loop],
        }
        for k, name in enumerate(names)
    )


def _corners(link: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, "m 3"]:
    """The corners of a link without those that lie on the one before."""
    apart = np.linalg.norm(np.diff(link, axis=0), axis=1) > 1e-6
    return link[np.concatenate([[True], apart])]


def robot_look(robot: Robot) -> Mapping[str, Any]:
    """How thick a robot's parts are drawn, millimetres, thinner towards the tool, and in which colours: the same in every scene.

    Returns:
        radii of links, radii and half lengths of the joints' drums, radii of a loop's bars and pins and of the tool; and colours.
    """
    first = LINK_RADIUS * robot.reach * 1e3
    share = np.arange(len(robot.joints) + 1) / (len(robot.joints) + 1)
    links, drums = first * (1.0 - 0.55 * share), first * (1.25 - 0.65 * share[:-1])
    return {
        "links": links.round(2).tolist(),
        "drums": drums.round(2).tolist(),
        "halves": (1.2 * drums).round(2).tolist(),
        "bar": round(0.4 * first, 2),
        "pin": round(0.6 * first, 2),
        "tool": round(0.35 * first, 2),
        "colours": MATERIALS,
    }


def _tracker(calibration: Calibration) -> Mapping[str, Any]:
    """Place of the measuring frame, or the direction in which it lies."""
    T, reach = calibration.T_tracker_base, calibration.model.robot.reach
    at = -T[:3, :3].T @ T[:3, 3]
    away = float(np.linalg.norm(at))
    if away <= MAX_DISTANCE * reach:
        label = "origin of the measuring frame" if away < AT_ORIGIN * reach else "tracker"
        return {"kind": "marker", "label": label, "colour": INK, "at": to_mm(at[None])}
    end = at / away * MAX_DISTANCE * reach
    return {"kind": "marker", "label": f"to the tracker, {away:.1f} m away", "colour": INK, "at": to_mm(end[None])}


def nice_scale(scale: float) -> float:
    """The nearest 1, 2 or 5 of a decade, from 1 to 10 000."""
    choices = np.array([m * 10.0**k for k in range(4) for m in (1, 2, 5)] + [1e4])
    return float(choices[np.argmin(np.abs(np.log(choices / max(scale, 1e-9))))])


def _length(error: Float[np.ndarray, " 3"]) -> float:
    return float(np.linalg.norm(error)) * 1e3
