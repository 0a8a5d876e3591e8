"""The example project: a virtual IRB 6660, a campaign that a virtual tracker measured of it, its task and a program."""

from importlib import resources
from pathlib import Path

from taskcal.errors import FileError
from taskcal.studio.project import LAYOUT, Project

ROBOT = "abb-irb6660-205-1.9"

POSES = 90
"""Of the campaign."""


def begin_example(folder: Path) -> Project:
    """Open the example, and write its files where they are missing.

    Raises:
        FileError: the folder cannot be made or written in.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(folder, f"cannot be made: {error.strerror or error}; name another") from error
    project = Project(folder)
    if project.choices.robot or project.files(LAYOUT.campaigns):
        return project
    contents = _contents()
    chosen = {kind: project.put(place, name, content, (Path(name).suffix,)) for kind, place, name, content in contents}
    project.choose(name="Virtual IRB 6660", robot=ROBOT, **chosen)
    return project


def _contents() -> list[tuple[str, str, str, bytes]]:
    """Choice, folder, name and content of every file."""
    # what they need takes a second to import, and a project that is there already needs nothing of it
    from math import radians

    import numpy as np

    from taskcal.demo.milling import milling_program
    from taskcal.demo.reference import reference_task
    from taskcal.measurement.virtual_cell import simulate
    from taskcal.measurement.writer import campaign_text
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel
    from taskcal.task.task import reach_task

    model = ErrorModel(load_robot(ROBOT))
    poses = reach_task(model, reference_task(radians(20.0)), POSES)
    campaign, _ = simulate(model, poses.q, rng=np.random.default_rng(0))
    program = milling_program(model.robot, reference_task(), rows=6).source
    task = (resources.files("taskcal.demo") / "reference-task.toml").read_bytes()
    return [
        ("campaign", LAYOUT.campaigns, "measured.csv", campaign_text(campaign, model.robot).encode()),
        ("task", LAYOUT.tasks, "milling.toml", task),
        ("program", LAYOUT.programs, program.path.name, program.encode()),
    ]
