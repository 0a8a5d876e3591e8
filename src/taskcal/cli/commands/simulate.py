"""``taskcal simulate``: a campaign of the virtual cell."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from taskcal.cli.option_groups import grouped
from taskcal.cli.options import OutputOptions, RobotOption, SpreadOptions, TaskOption
from taskcal.cli.output import tell, write_json
from taskcal.cli.outputs import check_outputs, files_of_task

REFLECTORS_MM = {"smr1": (60.0, 10.0, -20.0), "smr2": (-45.0, 55.0, 15.0), "smr3": (-20.0, -70.0, 35.0)}
"""Three reflectors about the tool point, in the tool frame, not on a line and no two alike."""


@dataclass(frozen=True, kw_only=True)
class TruthOptions:
    """Where the virtual robot's truth goes, or comes from."""

    truth: Annotated[
        Path | None,
        typer.Option(
            "--truth",
            metavar="TRUTH.json",
            readable=False,
            help="Write the true defects, tracker frame and targets here.",
        ),
    ] = None
    truth_from: Annotated[
        Path | None,
        typer.Option(
            "--truth-from",
            metavar="TRUTH.json",
            readable=False,
            help="Measure the robot of this truth again, its tracker frame and targets; another --seed for other noise.",
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class ReflectorOptions:
    """What the tool carries.

    Raises:
        typer.BadParameter: a number of reflectors that is not offered, or several where poses are measured.
    """

    targets: Annotated[
        int | None, typer.Option("--targets", metavar="1|3", help="Reflectors on the tool; 1 by default.")
    ] = None
    pose: Annotated[bool, typer.Option("--pose", help="Measure poses instead of points.")] = False

    def __post_init__(self) -> None:
        if self.targets not in (None, 1, 3):
            raise typer.BadParameter(
                f"{self.targets} reflectors are not offered; choose 1 or 3", param_hint="--targets"
            )
        if self.pose and self.targets not in (None, 1):
            raise typer.BadParameter(
                "a measured pose has one target; leave out --targets", param_hint="--pose / --targets"
            )


@grouped
def command(
    robot: RobotOption,
    task: TaskOption,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="CAMPAIGN.csv", readable=False, help="Campaign to write.")
    ],
    spread: SpreadOptions,
    truth: TruthOptions,
    reflectors: ReflectorOptions,
    out: OutputOptions,
) -> None:
    """Measure a virtual robot: defects drawn from its tolerances, a laser tracker with its noise."""
    if reflectors.targets is not None and truth.truth_from is not None:
        raise typer.BadParameter("the truth has its own targets", param_hint="--targets / --truth-from")
    outputs = check_outputs(
        "simulate",
        [("--output", output), ("--truth", truth.truth)],
        [robot, *files_of_task(task), truth.truth_from],
        force=out.force,
    )
    import numpy as np

    from taskcal.cli.task_poses import read_and_reach
    from taskcal.cli.truth_file import read_truth, truth_text
    from taskcal.measurement.virtual_cell import simulate
    from taskcal.measurement.writer import campaign_text
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel

    model = ErrorModel(load_robot(robot))
    drawn = None if truth.truth_from is None else read_truth(truth.truth_from, model)
    poses = read_and_reach(model, task, spread.count, spread.seed)
    targets = {name: np.array(p) * 1e-3 for name, p in REFLECTORS_MM.items()} if reflectors.targets == 3 else None
    rng, pose = np.random.default_rng(spread.seed), reflectors.pose
    if drawn is None:
        campaign, true = simulate(model, poses.q, rng=rng, targets=targets, pose=pose)
    else:
        campaign, true = simulate(
            model, poses.q, rng=rng, pose=pose, x=drawn.x, targets=drawn.targets, T_tracker_base=drawn.T_tracker_base
        )
    contents: dict[Path, str | bytes] = {output: campaign_text(campaign, model.robot)}
    if truth.truth is not None:
        contents[truth.truth] = truth_text(true, campaign.targets)
    outputs.write(contents)
    share = float(poses.unreachable.mean())
    if out.as_json:
        result = {
            "campaign": output,
            "truth": truth.truth,
            "truth_from": truth.truth_from,
            "robot": model.robot.name,
            "rows": len(campaign),
            "seed": spread.seed,
        }
        write_json({**result, "targets": campaign.targets, "pose": reflectors.pose, "unreachable_share": share})
        return
    tell(f"wrote {output}: {len(campaign)} rows of {model.robot.name}, targets {', '.join(campaign.targets)}")
    tell(f"{share:.1%} of the task's poses are out of reach")
    if truth.truth is not None:
        tell(f"wrote {truth.truth}: the defects, tracker frame and targets it was made from")
