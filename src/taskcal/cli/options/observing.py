"""What ``taskcal plan`` lets the user say of measuring without a tracker: what stands where, and what the tool carries."""

from dataclasses import dataclass, fields
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.options.common import check_above_zero
from taskcal.cli.output import info, show_table

if TYPE_CHECKING:
    import numpy as np

    from taskcal.cli.options.campaign import CampaignOptions
    from taskcal.kinematics.clearance import Box
    from taskcal.observations.socket import SocketDistance
    from taskcal.planning.instruments import MeasuringWay
    from taskcal.planning.plan import Plan
    from taskcal.robot.error_model import ErrorModel
    from taskcal.robot.robot import Robot
    from taskcal.task.task import Task
    from taskcal.virtual.station import Standing


STEM_MM = 100.0
"""How far before the flange the tool carries something, where the robot's file knows of no tool."""


class WayChoice(StrEnum):
    """How a robot is measured."""

    tracker = "tracker"
    socket = "socket"
    wire = "wire"
    camera = "camera"
    board = "board"


ALLOWED = {
    "sockets": ("socket",),
    "approach_mm": ("socket",),
    "anchors": ("wire",),
    "landmarks": ("camera", "board"),
    "fov_deg": ("camera", "board"),
    "range_mm": ("wire", "camera", "board"),
    "cone_deg": ("socket", "wire", "camera", "board"),
    "mounted_mm": ("socket", "wire", "camera", "board"),
    "mounted_axis": ("socket", "wire", "camera", "board"),
}
"""Ways of measuring that each option speaks of."""


@dataclass(frozen=True, kw_only=True)
class ObservingOptions:
    """How to measure, and what stands where.

    Raises:
        typer.BadParameter: an option of another way of measuring, or numbers that cannot be.
    """

    observe: Annotated[
        WayChoice,
        typer.Option(
            "--observe",
            help="A tracker; or without one a ball in sockets, a wire, landmarks or boards before a wrist camera.",
        ),
    ] = WayChoice.tracker
    sockets: Annotated[
        Path | None,
        typer.Option(
            "--sockets",
            metavar="SOCKETS.csv",
            readable=False,
            help="Where sockets stand, about: place, socket, x_mm y_mm z_mm in the base, i j k out of the socket (up if left out). "
            "Without it a block is assumed at three places where the task is.",
        ),
    ] = None
    anchors: Annotated[
        Path | None,
        typer.Option(
            "--anchors",
            metavar="ANCHORS.csv",
            readable=False,
            help="Where a wire's anchors stand, about: anchor, x_mm y_mm z_mm. Without it three are assumed around the task.",
        ),
    ] = None
    landmarks: Annotated[
        Path | None,
        typer.Option(
            "--landmarks",
            metavar="LANDMARKS.csv",
            readable=False,
            help="Where landmarks or boards stand, about: landmark, x_mm y_mm z_mm, i j k towards where it is seen from. "
            "Without it three are assumed before the task.",
        ),
    ] = None
    mounted_mm: Annotated[
        str | None,
        typer.Option(
            "--mounted-mm",
            metavar="X,Y,Z",
            help="Where the tool carries ball, wire's end or camera, roughly, in its frame; by default the tool point, or 100 mm "
            "before the flange of a robot without a tool.",
        ),
    ] = None
    mounted_axis: Annotated[
        str | None,
        typer.Option(
            "--mounted-axis",
            metavar="I,J,K",
            help="Where the stem or the camera points, in the tool's frame; its z axis by default.",
        ),
    ] = None
    cone_deg: Annotated[
        float | None,
        typer.Option(
            "--cone-deg",
            metavar="DEG",
            help="Largest angle between stem and socket (45), wire and where the tool points (110), or between a landmark's "
            "normal and the line of sight (45).",
        ),
    ] = None
    approach_mm: Annotated[
        float | None,
        typer.Option(
            "--approach-mm", metavar="MM", help="Distance from which a socket is approached along its axis (50)."
        ),
    ] = None
    range_mm: Annotated[
        str | None,
        typer.Option(
            "--range-mm",
            metavar="LOW,HIGH",
            help="Lengths that the wire has (100,2000), or distances at which the camera measures (200,600).",
        ),
    ] = None
    fov_deg: Annotated[
        float | None,
        typer.Option("--fov-deg", metavar="DEG", help="Full angle that the camera sees (40)."),
    ] = None

    def __post_init__(self) -> None:
        for option in fields(self):
            ways = ALLOWED.get(option.name, ())
            if ways and getattr(self, option.name) != option.default and self.observe.value not in ways:
                raise typer.BadParameter(
                    f"this is of --observe {' or '.join(ways)}; name that, or leave it out",
                    param_hint=_name(option.name),
                )
        for option in ("cone_deg", "approach_mm", "fov_deg"):
            check_above_zero(getattr(self, option), _name(option))
        for option in ("cone_deg", "fov_deg"):
            if (getattr(self, option) or 0.0) >= 180.0:
                raise typer.BadParameter(f"{getattr(self, option):g} is not below 180", param_hint=_name(option))
        low, high = self.limits or (0.0, 1.0)
        if not 0.0 <= low < high:
            raise typer.BadParameter(
                f"'{self.range_mm}' is not a lower and a higher limit; write for example 100,2000",
                param_hint="--range-mm",
            )
        _vector(self.mounted_mm, "--mounted-mm")
        axis = _vector(self.mounted_axis, "--mounted-axis")
        if axis is not None and not any(axis):
            raise typer.BadParameter("0,0,0 is not a direction; write for example 0,0,1", param_hint="--mounted-axis")

    @property
    def files(self) -> tuple[Path | None, ...]:
        """Files that are read."""
        return self.sockets, self.anchors, self.landmarks

    @property
    def limits(self) -> tuple[float, float] | None:
        """Lengths of a wire or distances of a camera, metres."""
        if self.range_mm is None:
            return None
        numbers = _numbers(self.range_mm, 2, "--range-mm")
        return numbers[0] * 1e-3, numbers[1] * 1e-3

    def mounted(self, model: "ErrorModel") -> "np.ndarray":
        """What the tool carries, in its frame."""
        import numpy as np

        from taskcal.geometry import se3
        from taskcal.task.orientation import towards

        given = _vector(self.mounted_mm, "--mounted-mm")
        bare = np.allclose(model.robot.T_flange_tool, np.eye(4))
        position = np.array(given or ((0.0, 0.0, STEM_MM) if bare else (0.0, 0.0, 0.0)), dtype=float) * 1e-3
        return se3.pose(
            towards(np.array(_vector(self.mounted_axis, "--mounted-axis") or (0.0, 0.0, 1.0), dtype=float)), position
        )

    def check(self, also: "CampaignOptions") -> None:
        """See that what is said of distances or of a wire's scale is of the way of measuring.

        Raises:
            typer.BadParameter: it is not.
        """
        for option, way in (("distances", WayChoice.socket), ("wire_scale", WayChoice.wire)):
            if getattr(also, option) and self.observe is not way:
                raise typer.BadParameter(
                    f"without a campaign this is of --observe {way.value}; name that, or leave it out",
                    param_hint=_name(option),
                )

    def load(
        self, model: "ErrorModel", task: "Task", keep_out: "tuple[Box, ...]", also: "CampaignOptions"
    ) -> "MeasuringWay | None":
        """How to measure; None with a tracker.

        Args:
            model: of the robot.
            task: what it has to do.
            keep_out: boxes.
            also: what is said of distances and of a wire's scale.

        Raises:
            FileError: a file cannot be read.
            ReachError: nothing is said of what stands, and the robot does not reach the task.
        """
        if self.observe is WayChoice.tracker:
            return None
        import numpy as np

        from taskcal.planning.instruments import BoardWay, CameraWay, SocketWay, WireWay

        tip = self.mounted(model)
        common: dict[str, Any] = {
            "standing": self._standing(model, task, tip),
            "T_tool_tip": tip,
            "keep_out": keep_out,
        }
        cone = None if self.cone_deg is None else float(np.radians(self.cone_deg))
        if self.observe is WayChoice.socket:
            more = {"cone": cone, "distance": None if self.approach_mm is None else self.approach_mm * 1e-3}
            return SocketWay(**common, distances=self._distances(common["standing"], also.distances), **_given(more))
        low, high = self.limits or (None, None)
        if self.observe is WayChoice.wire:
            return WireWay(
                **common, scaled=also.wire_scale, **_given({"angle": cone, "shortest": low, "longest": high})
            )
        view = None if self.fov_deg is None else float(np.radians(self.fov_deg))
        more = {"tilt": cone, "nearest": low, "farthest": high, "field_of_view": view}
        return {WayChoice.camera: CameraWay, WayChoice.board: BoardWay}[self.observe](**common, **_given(more))

    @property
    def stated(self) -> Path | None:
        """File of what stands."""
        return next((path for path in self.files if path is not None), None)

    def _standing(self, model: "ErrorModel", task: "Task", tip: "np.ndarray") -> "Standing":
        from taskcal.planning.instruments import stand_by_default, way_named
        from taskcal.virtual.station import load_standing

        if self.stated is not None:
            return load_standing(self.stated, way_named(self.observe.value).label)
        assert self.observe is not WayChoice.tracker
        return stand_by_default(self.observe.value, model, task, tip, self.limits)

    def _distances(self, standing: "Standing", path: Path | None) -> "tuple[SocketDistance, ...]":
        """Stated distances of sockets; of the block that is assumed the one that it is assumed to have."""
        from taskcal.planning.instruments import block_distances
        from taskcal.reading.stated_scale import read_distances

        if path is not None:
            return read_distances(path, standing.names)
        return block_distances() if self.sockets is None else ()


def _given(options: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in options.items() if value is not None}


def _name(option: str) -> str:
    return f"--{option.replace('_', '-')}"


def _vector(text: str | None, option: str) -> tuple[float, ...] | None:
    return None if text is None else _numbers(text, 3, option)


def _numbers(text: str, count: int, option: str) -> tuple[float, ...]:
    """Numbers parted by commas.

    Raises:
        typer.BadParameter: they are not so many finite numbers.
    """
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(abs(number) <= 1e6 for number in numbers):
        raise typer.BadParameter(f"'{text}' is not {count} numbers with commas between them", param_hint=option)
    return numbers


# What ``taskcal plan`` says of a plan without a tracker: what stands where, what to check, what to write down.

MOST_NAMED = 12
"""Poses that a message names."""


def describe_standing(standing: "Standing") -> list[dict[str, Any]]:
    """What stands where, in millimetres."""
    return [
        {"name": name, "position_mm": (position * 1e3).tolist(), "direction": direction.tolist()}
        for name, position, direction in zip(standing.names, standing.position, standing.direction, strict=True)
    ]


def tell_how_to_measure(plan: "Plan", robot: "Robot", *, stated: bool) -> None:
    """Show what stands where with its number of poses, and say what to check and to write down.

    Args:
        plan: without a tracker.
        robot: the robot.
        stated: whether a file says what stands where.
    """
    import numpy as np

    way = plan.way
    assert way is not None
    whose = "as stated" if stated else "assumed"
    turned = way.directed
    rows: list[tuple[str, ...]] = []
    for name, position, direction in zip(
        way.standing.names, way.standing.position, way.standing.direction, strict=True
    ):
        number = str(plan.names.count(name))
        facing = [f"{value + 0.0:.2f}" for value in np.round(direction, 2)] if turned else []
        rows.append((name, *(f"{value * 1e3:.0f}" for value in position), *facing, number))
    show_table(
        f"Where every {way.label} stands in the base, {whose}: mm{', and its direction' if turned else ''}",
        (way.label, "x_mm", "y_mm", "z_mm", *(("i", "j", "k") if turned else ()), "poses"),
        rows,
    )
    info(way.filled_in)
    if not stated:
        info(f"nobody said where the {way.label}s stand: put them there, or say where they do and plan anew")
    x, y, z = way.T_tool_tip[:3, 3] * 1e3
    info(f"what the tool carries is taken to be at {x:g}, {y:g}, {z:g} mm in its frame (--mounted-mm)")
    if robot.link_radii is None:
        info("the robot's file states no link radii, so that nothing was checked for collisions: drive the plan slowly")
    else:
        info(
            "the links were checked against each other, blocks and keep-out boxes, on the ways between poses too; cables, tool "
            "and cell were not: drive slowly"
        )
    round_about, none = ([one.pose for one in plan.tight if (one.via is not None) == found] for found in (True, False))
    if round_about:
        info(f"not clear from the pose before if all joints turn at once: {_some(round_about)}; a program goes round")
    if none:
        info(
            f"not clear from the pose before, and no way round was found: {_some(none)}; drive there by hand, not by a program"
        )


def _some(poses: list[int]) -> str:
    return ", ".join(map(str, poses[:MOST_NAMED])) + (" …" if len(poses) > MOST_NAMED else "")


# Ways to measure that an option names.


def known_ways(observe: str) -> str:
    """One or several with a plus between, all of them known.

    Raises:
        typer.BadParameter: there is no such way.
    """
    from taskcal.errors import CampaignError, UnknownName
    from taskcal.virtual.cell import SimulationOptions

    try:
        return SimulationOptions(observe=observe).observe
    except (UnknownName, CampaignError) as error:
        raise typer.BadParameter(str(error), param_hint="--observe") from error
