"""``taskcal simulate``: a campaign of the virtual cell."""

from pathlib import Path
from typing import Annotated

import typer

from taskcal.cli.options import CountOption, ForceOption, JsonOption, RobotOption, SeedOption, TaskOption
from taskcal.cli.output import announce_compilation, tell, write_json
from taskcal.cli.outputs import check_outputs, files_of_task

REFLECTORS_MM = {"smr1": (60.0, 10.0, -20.0), "smr2": (-45.0, 55.0, 15.0), "smr3": (-20.0, -70.0, 35.0)}
"""Three reflectors about the tool point, in the tool frame, not on a line and no two alike."""


def command(
    robot: RobotOption,
    task: TaskOption,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="CAMPAIGN.csv", readable=False, help="Campaign to write.")
    ],
    count: CountOption = 60,
    seed: SeedOption = 0,
    truth: Annotated[
        Path | None,
        typer.Option(
            "--truth",
            metavar="TRUTH.json",
            readable=False,
            help="Write the true defects, tracker frame and targets here.",
        ),
    ] = None,
    truth_from: Annotated[
        Path | None,
        typer.Option(
            "--truth-from",
            metavar="TRUTH.json",
            readable=False,
            help="Measure the robot of this truth again, its tracker frame and targets; another --seed for other noise.",
        ),
    ] = None,
    targets: Annotated[
        int | None, typer.Option("--targets", metavar="1|3", help="Reflectors on the tool; 1 by default.")
    ] = None,
    pose: Annotated[bool, typer.Option("--pose", help="Measure poses instead of points.")] = False,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Measure a virtual robot: defects drawn from its tolerances, a laser tracker with its noise."""
    if targets is not None and truth_from is not None:
        raise typer.BadParameter("the truth has its own targets", param_hint="--targets / --truth-from")
    if targets not in (None, 1, 3):
        raise typer.BadParameter(f"{targets} reflectors are not offered; choose 1 or 3", param_hint="--targets")
    if pose and targets not in (None, 1):
        raise typer.BadParameter("a measured pose has one target; leave out --targets", param_hint="--pose / --targets")
    outputs = check_outputs(
        "simulate",
        [("--output", output), ("--truth", truth)],
        [robot, *files_of_task(task), truth_from],
        force=force,
    )
    import numpy as np

    from taskcal.cli.task_poses import read_and_reach
    from taskcal.cli.truth_file import read_truth, truth_text
    from taskcal.measurement.virtual_cell import simulate
    from taskcal.measurement.writer import campaign_text
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel

    model = ErrorModel(load_robot(robot))
    known = None if truth_from is None else read_truth(truth_from, model)
    announce_compilation()
    poses = read_and_reach(model, task, count, seed)
    reflectors = {name: np.array(p) * 1e-3 for name, p in REFLECTORS_MM.items()} if targets == 3 else None
    rng = np.random.default_rng(seed)
    if known is None:
        campaign, made_from = simulate(model, poses.q, rng=rng, targets=reflectors, pose=pose)
    else:
        campaign, made_from = simulate(
            model, poses.q, rng=rng, pose=pose, x=known.x, targets=known.targets, T_tracker_base=known.T_tracker_base
        )
    contents: dict[Path, str | bytes] = {output: campaign_text(campaign, model.robot)}
    if truth is not None:
        contents[truth] = truth_text(made_from, campaign.targets)
    outputs.write(contents)
    share = float(poses.unreachable.mean())
    if as_json:
        result = {
            "campaign": output,
            "truth": truth,
            "truth_from": truth_from,
            "robot": model.robot.name,
            "rows": len(campaign),
            "seed": seed,
        }
        write_json({**result, "targets": campaign.targets, "pose": pose, "unreachable_share": share})
        return
    tell(f"wrote {output}: {len(campaign)} rows of {model.robot.name}, targets {', '.join(campaign.targets)}")
    tell(f"{share:.1%} of the task's poses are out of reach")
    if truth is not None:
        tell(f"wrote {truth}: the defects, tracker frame and targets it was made from")
