"""``taskcal simulate``: a campaign of the virtual cell."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import typer
from jaxtyping import Float
from pydantic import Field

import taskcal
from taskcal.cli.command import Told, option, output_option
from taskcal.cli.options.common import (
    REACHING,
    RobotOption,
    SpreadOptions,
    TaskOption,
    read_and_reach,
)
from taskcal.cli.options.observing import check_instruments
from taskcal.cli.progress import bar_over
from taskcal.cli.run import File, OutputOptions, Result
from taskcal.errors import FileError, TaskcalError, shown
from taskcal.io.codec import LACKS, decode, describe
from taskcal.io.json_file import parse_json
from taskcal.io.text_file import read_text
from taskcal.observations import Observation, instrument_classes, instrument_of
from taskcal.report.content import Facts, Section
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import Truth
from taskcal.virtual.options import SimulationOptions
from taskcal_groundwork.options import Written

if TYPE_CHECKING:
    from taskcal.virtual.pictures import VirtualCamera

REFLECTORS_MM = {"smr1": (60.0, 10.0, -20.0), "smr2": (-45.0, 55.0, 15.0), "smr3": (-20.0, -70.0, 35.0)}
"""Three reflectors about the TCP, in the tool frame, not on a line and no two alike."""


MEASURING = "measuring"


@dataclass(frozen=True, kw_only=True)
class ReflectorOptions:
    """Reflectors on the tool.

    Raises:
        typer.BadParameter: a number of reflectors that is not offered.
    """

    targets: int | None = option(None, "1|3", "Reflectors on the tool; 1 by default.")

    def __post_init__(self) -> None:
        if self.targets not in (None, 1, 3):
            raise typer.BadParameter(
                f"{self.targets} reflectors are not offered; choose 1 or 3", param_hint="--targets"
            )


PIXELS, IMAGE_SIZE = "pixels", "1600x1200"


@dataclass(frozen=True, kw_only=True)
class CameraOptions:
    """Board and camera of ``--observe pixels``."""

    board: Path | None = option(None, "BOARD.toml", "With --observe pixels: the boards, which stand side by side.")
    camera_file: Path | None = option(
        None, "CAMERA.toml|.yaml", "The camera, in place of --image-size and --focal-px.", named="camera"
    )
    image_size: str = option(IMAGE_SIZE, "WIDTHxHEIGHT", "Size of an image, pixels.")
    focal_px: float | None = option(
        None, "PX", "Focal length; by default 0.9 of the image's width.", low=0.0, ends=False
    )
    noise_px: float = option(0.15, "PX", "Noise of a corner in each direction, 1σ.", low=0.0)
    images: Path | None = option(None, "FOLDER", "Render the images into this folder.", writes="later")

    def check(self, observe: str) -> None:
        """See that a board is given for images, and only for them.

        Raises:
            typer.BadParameter: it is not.
        """
        if (observe == PIXELS) != (self.board is not None) or (self.images is not None and self.board is None):
            raise typer.BadParameter(
                "images are of a board, and alone: give --observe pixels and --board BOARD.toml together",
                param_hint="--observe / --board / --images",
            )

    def camera(self) -> "VirtualCamera":
        """The camera.

        Raises:
            typer.BadParameter: the size of an image is none.
        """
        from taskcal.observations.camera import Lens
        from taskcal.virtual.pictures import VirtualCamera

        if self.camera_file is not None:
            from taskcal.observations.camera_file import read_camera

            if self.focal_px is not None or self.image_size != IMAGE_SIZE:
                raise typer.BadParameter(
                    "states size and focal length; leave --image-size and --focal-px out", param_hint="--camera"
                )
            given = read_camera(self.camera_file)
            return VirtualCamera(lens=given.lens, numbers=given.numbers, noise_px=self.noise_px)
        found = re.fullmatch(r"(\d{2,5})x(\d{2,5})", self.image_size)
        if found is None:
            raise typer.BadParameter(
                f"'{self.image_size}' is not a size; write for example 1600x1200", param_hint="--image-size"
            )
        lens = Lens(model="pinhole", width=int(found[1]), height=int(found[2]))
        focal = 0.9 if self.focal_px is None else self.focal_px / lens.width
        return VirtualCamera(lens=lens, numbers=lens.start(focal), noise_px=self.noise_px)

    def take(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], output: Path, seed: int, options: SimulationOptions
    ) -> tuple[str, list[File], Truth]:
        """The rows of a campaign of images, its images and its truth."""
        from taskcal.observations.calibration_board import read_boards
        from taskcal.reading.pictures import Corners
        from taskcal.reading.writer import joints_text
        from taskcal.virtual.pictures import render_shots, take_shots

        assert self.board is not None
        boards, camera, rng = read_boards(self.board), self.camera(), np.random.default_rng(seed)
        shots, truth = take_shots(model, q, boards, camera, rng=rng, options=options)
        names = tuple(f"{k:04d}.png" for k in range(len(q)))
        corners = Corners(
            source=output.name,
            images=names,
            width=camera.lens.width,
            height=camera.lens.height,
            image=shots.image,
            board=tuple(boards[b].name for b in shots.board),
            id=shots.id,
            pixel=shots.pixel,
        ).table()
        rows = np.array([names.index(name) for name in corners["image"]], dtype=int)
        pictures = () if self.images is None else zip(names, render_shots(shots, boards, camera, rng), strict=True)
        images = [] if self.images is None else [File("", self.images / name, png) for name, png in pictures]
        return joints_text(shots.q[rows], model.robot, corners), images, truth


@dataclass(frozen=True, kw_only=True)
class ObserveOptions:
    """Instrument of the simulation.

    Raises:
        typer.BadParameter: distances without sockets.
    """

    observe: str = option(
        "tracker", "INSTRUMENT", f"Instrument: {', '.join(instrument_classes())}; several: socket+wire."
    )
    distances: Path | None = option(None, "DISTANCES.csv", "Write the stated distances of sockets here.", writes="new")

    def __post_init__(self) -> None:
        check_instruments(self.observe)
        if self.distances is not None and not self.lengths:
            raise typer.BadParameter(
                "only sockets have stated distances; add --observe socket, or leave it out", param_hint="--distances"
            )

    @property
    def kinds(self) -> "list[type[Observation]]":
        """Kinds of observation that the instruments make."""
        return [instrument_of(name) for name in self.observe.split("+")]

    @property
    def tracked(self) -> bool:
        """Whether a tracker measures alone."""
        return all(kind.in_tracker for kind in self.kinds)

    @property
    def lengths(self) -> str:
        """Name the lengths that may be stated beside the rows; empty for none."""
        return next((kind.stated_lengths for kind in self.kinds if kind.stated_lengths), "")


def command(
    *,
    robot: RobotOption,
    task: TaskOption,
    output: Path = output_option(..., "CAMPAIGN.csv", "Output CSV: the campaign."),
    spread: SpreadOptions,
    truth: Path | None = option(
        None, "TRUTH.json", "Write the true parameters, tracker frame and targets here.", writes="new"
    ),
    truth_from: Path | None = option(
        None, "TRUTH.json", "Measure the robot of this truth again; another --seed gives other noise."
    ),
    reflectors: ReflectorOptions,
    how: ObserveOptions,
    choice: Annotated[Written[SimulationOptions], Told(("observe",))],
    camera: CameraOptions,
    out: OutputOptions,
) -> Result:
    """Simulate a campaign of a simulated robot drawn from its tolerances."""
    if reflectors.targets is not None and not how.tracked:
        raise typer.BadParameter("only for a tracker; omit it", param_hint="--targets / --observe")
    if choice.pose and reflectors.targets not in (None, 1):
        raise typer.BadParameter("a measured pose has one target; leave out --targets", param_hint="--pose / --targets")
    if reflectors.targets is not None and truth_from is not None:
        raise typer.BadParameter("the truth has its own targets", param_hint="--targets / --truth-from")
    camera.check(how.observe)
    from taskcal.campaigns.campaign import distances_text
    from taskcal.reading.writer import campaign_text
    from taskcal.robot.error_model import ErrorModel

    model = ErrorModel(taskcal.load_robot(robot))
    drawn = None if truth_from is None else read_truth(truth_from, model)
    targets = {name: np.array(p) * 1e-3 for name, p in REFLECTORS_MM.items()} if reflectors.targets == 3 else None
    options = choice.made(
        targets=targets if drawn is None else {name: T[:3, 3] for name, T in drawn.targets.items()},
        x=None if drawn is None else np.array([drawn.x[name] for name in model.names]),
        T_tracker_base=None if drawn is None else drawn.T_tracker_base,
    )
    with bar_over([REACHING, MEASURING]) as begin:
        poses = read_and_reach(model, task, spread.count, spread.seed, begin)
        begin(MEASURING)
        if camera.board is not None:
            text, others, true = camera.take(model, poses.q, output, spread.seed, options)
            measured: tuple[str, ...] = ("camera",)
        else:
            campaign, true = taskcal.simulate(model, poses.q, rng=np.random.default_rng(spread.seed), options=options)
            text, measured = campaign_text(campaign, model.robot), campaign.targets
            stated = "" if how.distances is None else distances_text(campaign)
            others = [File("distances", how.distances, stated, f": {how.lengths}")]
    rows = f": {len(poses.q)} rows of {model.robot.name}, targets {', '.join(measured)}"
    known = ": the true parameters, tracker frame and targets"
    result = {
        "campaign": output,
        "truth": truth,
        "truth_from": truth_from,
        "robot": model.robot.name,
        "rows": len(poses.q),
        "seed": spread.seed,
        "observe": how.observe,
        "distances": how.distances,
        "targets": measured,
        "pose": choice.pose,
        "stations": choice.stations,
        "unreachable_share": float(poses.unreachable.mean()),
    }
    return Result(
        summary=result,
        sections=lambda: [_section(result, how.lengths)],
        files=[File("campaign", output, text, rows), *others, File("truth", truth, truth_text(true, measured), known)],
    )


def _section(result: Mapping[str, Any], lengths: str) -> Section:
    """What is to be known of what was written."""
    out, left_out = result["unreachable_share"], lengths and result["distances"] is None
    scale = f"{lengths}, which determine the robot's scale, are not written; name a file with --distances"
    return Section(
        "Campaign",
        Facts(
            ("out of reach", f"{out:.1%} of the task's poses") if out else None,
            ("distances", scale) if left_out else None,
        ),
    )


# The file of a simulated robot's truth: defects, tracker frame and targets; written and read back.


@dataclass(frozen=True, eq=False, kw_only=True)
class KnownTruth:
    """Truth from which a simulated robot is measured."""

    robot: str
    units: Literal["metres and radians"] = "metres and radians"
    x: Mapping[str, float]
    """Defects, by the names of the model's parameters."""
    T_tracker_base: Float[np.ndarray, "4 4"]
    targets: Annotated[Mapping[str, Float[np.ndarray, "4 4"]], Field(min_length=1)]
    """Poses in the tool frame."""
    unknowns: Annotated[Mapping[str, float], LACKS] = field(default_factory=dict[str, float])
    """Of what observes the targets, if not a tracker."""


def truth_text(truth: Truth, targets: tuple[str, ...]) -> str:
    """The file of what a campaign was made from."""
    content = KnownTruth(
        robot=truth.model.robot.name,
        x=dict(zip(truth.model.names, truth.x.tolist(), strict=True)),
        T_tracker_base=truth.T_tracker_base,
        targets=dict(zip(targets, truth.T_tool_target, strict=True)),
        unknowns=truth.unknowns,
    )
    return json.dumps(describe(content), indent=1, allow_nan=False) + "\n"


def read_truth(path: Path, model: ErrorModel) -> KnownTruth:
    """Read what `truth_text` gives.

    Raises:
        FileError: it is missing, no truth, or that of another robot.
    """
    try:
        text = read_text(path, otherwise="is not JSON; write one with taskcal simulate --truth")
        data: Any = parse_json(text, path)
    except (ValueError, RecursionError) as error:
        raise FileError(path, f"is not JSON: {error}; write one with taskcal simulate --truth") from error
    try:
        known = decode(KnownTruth, data)
    except TaskcalError as error:
        message = f"is not the truth of a simulated robot: {error}; make one with simulate --truth"
        raise FileError(path, message) from error
    robot = shown(known.robot)
    if known.robot != model.robot.name:
        raise FileError(path, f"was simulated for {robot}, not {model.robot.name}; pass --robot {robot}")
    odd = sorted(set(known.x) ^ set(model.names))
    if odd:
        raise FileError(path, f"and the model of {robot} differ in parameter '{shown(odd[0])}'; simulate it again")
    return known
