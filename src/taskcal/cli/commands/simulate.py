"""``taskcal simulate``: a campaign of the virtual cell."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer
from jaxtyping import Float

import taskcal
from taskcal.cli.command import option
from taskcal.cli.options.common import (
    REACHING,
    OutputOptions,
    RobotOption,
    SpreadOptions,
    TaskOption,
    above_zero,
    not_negative,
    read_and_reach,
)
from taskcal.cli.options.observing import check_instruments
from taskcal.cli.output import files_of_task, plain, tell
from taskcal.cli.progress import bar_over
from taskcal.errors import FileError
from taskcal.io.json_file import parse_json
from taskcal.io.text_file import read_text
from taskcal.observations import Observation, instrument_classes, instrument_of
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import SimulationOptions, Truth

if TYPE_CHECKING:
    from taskcal.virtual.pictures import VirtualCamera

REFLECTORS_MM = {"smr1": (60.0, 10.0, -20.0), "smr2": (-45.0, 55.0, 15.0), "smr3": (-20.0, -70.0, 35.0)}
"""Three reflectors about the TCP, in the tool frame, not on a line and no two alike."""


MEASURING = "measuring"


@dataclass(frozen=True, kw_only=True)
class ReflectorOptions:
    """Reflectors on the tool.

    Raises:
        typer.BadParameter: a number of reflectors that is not offered, or several where poses are measured.
    """

    targets: int | None = option(None, "1|3", "Reflectors on the tool; 1 by default.")
    pose: bool = option(False, help="Measure poses instead of points.")
    stations: int = option(1, "N", "Places that the tracker is moved to, as many rows at each.", min=1)

    def __post_init__(self) -> None:
        if self.targets not in (None, 1, 3):
            raise typer.BadParameter(
                f"{self.targets} reflectors are not offered; choose 1 or 3", param_hint="--targets"
            )
        if self.pose and self.targets not in (None, 1):
            raise typer.BadParameter(
                "a measured pose has one target; leave out --targets", param_hint="--pose / --targets"
            )


PIXELS, IMAGE_SIZE = "pixels", "1600x1200"


@dataclass(frozen=True, kw_only=True)
class CameraOptions:
    """Board and camera of ``--observe pixels``."""

    board: Path | None = option(None, "BOARD.toml", "With --observe pixels: the boards, which stand side by side.")
    camera_file: Path | None = option(
        None, "CAMERA.toml|.yaml", "The camera, in place of --image-size and --focal-px.", named="--camera"
    )
    image_size: str = option(IMAGE_SIZE, "WIDTHxHEIGHT", "Size of an image, pixels.")
    focal_px: float | None = option(
        None, "PX", "Focal length; by default 0.9 of the image's width.", callback=above_zero
    )
    noise_px: float = option(0.15, "PX", "Noise of a corner in each direction, 1σ.", callback=not_negative)
    images: Path | None = option(None, "FOLDER", "Render the images into this folder.")

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
    ) -> tuple[dict[Path | None, str | bytes], Truth]:
        """The files of a campaign of images, and its truth."""
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
        contents: dict[Path | None, str | bytes] = {output: joints_text(shots.q[rows], model.robot, corners)}
        if self.images is not None:
            pictures = render_shots(shots, boards, camera, rng)
            contents |= {self.images / name: png for name, png in zip(names, pictures, strict=True)}
        return contents, truth


@dataclass(frozen=True, kw_only=True)
class ObserveOptions:
    """Instrument of the simulation, and errors outside the model.

    Raises:
        typer.BadParameter: distances without sockets, or places for a tracker.
    """

    observe: str = option(
        "tracker", "INSTRUMENT", f"Instrument: {', '.join(instrument_classes())}; several: socket+wire."
    )
    places: int | None = option(
        None, "N", "Blocks of sockets, anchors, planes (default 3), landmarks, boards or cubes (1).", min=1
    )
    distances: Path | None = option(None, "DISTANCES.csv", "Write the stated distances of sockets here.")
    model_error_mm: float = option(0.0, "MM", "Model error, 1σ per axis.", callback=not_negative)
    joint_error_deg: float = option(
        0.0, "DEG", "Difference of true and controller joint values, 1σ.", callback=not_negative
    )

    def __post_init__(self) -> None:
        check_instruments(self.observe)
        if self.distances is not None and not self.lengths:
            raise typer.BadParameter(
                "only sockets have stated distances; add --observe socket, or leave it out", param_hint="--distances"
            )
        if self.places is not None and self.tracked:
            raise typer.BadParameter(
                "a tracker needs no places; add --observe socket, wire, camera …", param_hint="--places"
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
    output: Path = option(..., "CAMPAIGN.csv", "Output CSV: the campaign.", also="-o"),
    spread: SpreadOptions,
    truth: Path | None = option(None, "TRUTH.json", "Write the true parameters, tracker frame and targets here."),
    truth_from: Path | None = option(
        None, "TRUTH.json", "Measure the robot of this truth again; another --seed gives other noise."
    ),
    reflectors: ReflectorOptions,
    how: ObserveOptions,
    camera: CameraOptions,
    out: OutputOptions,
) -> None:
    """Simulate a campaign of a simulated robot drawn from its tolerances."""
    if (reflectors.pose or reflectors.targets is not None or reflectors.stations > 1) and not how.tracked:
        raise typer.BadParameter(
            "only for a tracker; omit them", param_hint="--targets / --pose / --stations / --observe"
        )
    if reflectors.targets is not None and truth_from is not None:
        raise typer.BadParameter("the truth has its own targets", param_hint="--targets / --truth-from")
    camera.check(how.observe)
    outputs = out.begin(
        "simulate",
        [("--output", output), ("--truth", truth), ("--distances", how.distances)],
        [robot, *files_of_task(task), truth_from, camera.board, camera.camera_file],
    )
    from taskcal.campaigns.campaign import distances_text
    from taskcal.reading.writer import campaign_text
    from taskcal.robot.error_model import ErrorModel

    model = ErrorModel(taskcal.load_robot(robot))
    drawn = None if truth_from is None else read_truth(truth_from, model)
    targets = {name: np.array(p) * 1e-3 for name, p in REFLECTORS_MM.items()} if reflectors.targets == 3 else None
    options = taskcal.virtual.SimulationOptions(
        targets=targets if drawn is None else drawn.targets,
        pose=reflectors.pose,
        stations=reflectors.stations,
        observe=how.observe,
        places=how.places,
        model_error=how.model_error_mm * 1e-3,
        joint_error=float(np.radians(how.joint_error_deg)),
        x=None if drawn is None else drawn.x,
        T_tracker_base=None if drawn is None else drawn.T_tracker_base,
    )
    with bar_over([REACHING, MEASURING]) as begin:
        poses = read_and_reach(model, task, spread.count, spread.seed, begin)
        begin(MEASURING)
        contents: dict[Path | None, str | bytes] = {}
        if camera.board is not None:
            contents, true = camera.take(model, poses.q, output, spread.seed, options)
            measured: tuple[str, ...] = ("camera",)
        else:
            campaign, true = taskcal.simulate(model, poses.q, rng=np.random.default_rng(spread.seed), options=options)
            contents[output], measured = campaign_text(campaign, model.robot), campaign.targets
            contents[how.distances] = "" if how.distances is None else distances_text(campaign)
    outputs.write({**contents, truth: truth_text(true, measured)})
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
        "pose": reflectors.pose,
        "stations": reflectors.stations,
        "unreachable_share": float(poses.unreachable.mean()),
    }
    out.give(result, lambda: _tell(result, how.lengths))


def _tell(result: Mapping[str, Any], lengths: str) -> None:
    """Print what was written."""
    tell(
        f"wrote {result['campaign']}: {result['rows']} rows of {result['robot']}, targets {', '.join(result['targets'])}"
    )
    if result["unreachable_share"]:
        tell(f"{result['unreachable_share']:.1%} of the task's poses are out of reach")
    if result["distances"] is not None:
        tell(f"wrote {result['distances']}: {lengths}")
    elif lengths:
        tell(f"{lengths}, which determine the robot's scale, are not written; name a file with --distances")
    if result["truth"] is not None:
        tell(f"wrote {result['truth']}: the true parameters, tracker frame and targets")


# The file of a simulated robot's truth: defects, tracker frame and targets; written and read back.


@dataclass(frozen=True, eq=False, kw_only=True)
class KnownTruth:
    """Truth from which a simulated robot is measured."""

    x: Float[np.ndarray, " p"]
    """Defects in the model's order, metres and radians."""
    T_tracker_base: Float[np.ndarray, "4 4"]
    targets: dict[str, Float[np.ndarray, " 3"]]
    """Centres in the tool frame, metres."""


def truth_text(truth: Truth, targets: tuple[str, ...]) -> str:
    """The file of what a campaign was made from."""
    content = {
        "robot": truth.model.robot.name,
        "units": "metres and radians",
        "x": dict(zip(truth.model.names, truth.x.tolist(), strict=True)),
        "T_tracker_base": truth.T_tracker_base,
        "targets": dict(zip(targets, truth.T_tool_target, strict=True)),
        "unknowns": dict(truth.unknowns),
    }
    return json.dumps(plain(content), indent=1, allow_nan=False) + "\n"


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
        robot, defects = str(data["robot"]), {str(name): float(value) for name, value in data["x"].items()}
        base = np.asarray(data["T_tracker_base"], dtype=float)
        targets = {str(name): np.asarray(T, dtype=float)[:3, 3] for name, T in data["targets"].items()}
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        message = (
            f"is not the truth of a simulated robot ({type(error).__name__}: {error}); make one with simulate --truth"
        )
        raise FileError(path, message) from error
    if robot != model.robot.name:
        raise FileError(path, f"was simulated for {robot}, not {model.robot.name}; pass --robot {robot}")
    odd = sorted(set(defects) ^ set(model.names))
    if odd:
        raise FileError(path, f"and the model of {robot} differ in parameter '{odd[0]}'; simulate it again")
    values = np.array([*defects.values(), *base.ravel(), *(c for p in targets.values() for c in p)])
    if base.shape != (4, 4) or not targets or not np.all(np.isfinite(values)):
        raise FileError(path, "is not a valid truth: a frame, a target or a number is wrong; simulate it again")
    return KnownTruth(x=np.array([defects[name] for name in model.names]), T_tracker_base=base, targets=targets)
