"""What commands left in a project, from what it was made, and where each step of the road stands by it."""

import hashlib
import json
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

from robot_programs.languages import languages
from taskcal.campaigns.campaign import Campaign
from taskcal.errors import TaskcalError
from taskcal.io.json_file import parse_json
from taskcal.io.toml_file import tables_of_task
from taskcal.reading.options import ReadOptions
from taskcal.reading.pictures import has_corners
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.robot import Robot
from taskcal.tables.forms import read_table
from taskcal_studio.project import LAYOUT, RESULT, Choices, Project
from taskcal_studio.stated_options import OF_IMAGES, stated_or_begun
from taskcal_studio.task_box import read_together

# What a command printed of a file that it wrote.


def result_of(path: str) -> str:
    """The file that keeps what a command printed of another file."""
    return path.removesuffix(".json") + RESULT


def read_result(project: Project, path: str, *keys: str) -> Mapping[str, Any] | None:
    """Read what a command printed of a file; None where that is not there, as for one that was put here by hand.

    Args:
        project: whose file it is.
        path: of the file that the command wrote.
        keys: that the result must have.
    """
    content = _read_json(project, result_of(path))
    return content if content is not None and set(keys) <= content.keys() else None


def _read_json(project: Project, path: str) -> Mapping[str, Any] | None:
    with suppress(OSError, ValueError, TaskcalError):
        file = project.path(path)
        content = parse_json(file.read_text(encoding="utf-8"), file)
        return content if isinstance(content, dict) else None
    return None


# What the choices of a project hold, and what a result was made from.


def robot_of(project: Project) -> Robot:
    """Load the project's robot.

    Raises:
        TaskcalError: it has none yet, or its file describes none.
    """
    named = project.choices.robot
    if not named:
        raise TaskcalError("choose a robot first")
    return load_robot(project.path(named) if "/" in named else named)


def shows_images(project: Project) -> bool:
    """Whether the chosen campaign has the corners that images show."""
    with suppress(TaskcalError):
        return bool(project.choices.campaign) and has_corners(read_table(project.path(project.choices.campaign)))
    return False


def read_measured(project: Project, robot: Robot) -> Campaign:
    """Read the chosen campaign, with the boards that its images show, whether or not these fit the robot.

    Raises:
        TaskcalError: it cannot be read.
    """
    choices = project.choices
    pictured = bool(choices.board) and shows_images(project)
    board, camera = (project.path(path) if path and pictured else None for path in (choices.board, choices.camera))
    options = ReadOptions(board=board, lens=choices.lens, camera=camera, judged=False)
    return read_campaign(project.path(choices.campaign), robot, options=options)


def options_of_images(project: Project) -> dict[str, str]:
    """Options of ``taskcal`` for the images of the chosen campaign; none where it has none."""
    return stated_of_images(project.choices) if project.choices.board and shows_images(project) else {}


def stated_of_images(choices: Choices) -> dict[str, str]:
    """Options of ``taskcal`` for what is stated of images: boards, lens and camera."""
    return {"board": choices.board, "lens": choices.lens, "camera": choices.camera}


MADE_FROM: Mapping[str, tuple[str, ...]] = {
    LAYOUT.plans: ("robot", "task", "station", "camera"),
    LAYOUT.calibrations: ("robot", "campaign"),
    LAYOUT.corrected: ("calibration", "program", "task", "cell"),
    LAYOUT.reports: ("calibration", "task", "campaign", "header", "corrected"),
}
"""Choices that the results in a folder are made from. The options of a fit are not among them: another model is another result."""


def contents(project: Project) -> Mapping[str, str]:
    """Digest of what each choice holds now; empty where there is nothing, or what cannot be read.

    A robot and a task count by what they describe with the files that they name; others by their bytes.
    """
    choices = project.choices
    found = {name: _digest(project, getattr(choices, name)) for name in ("station", "calibration", "campaign")}
    if found["campaign"] and (stated := options_of_images(project)):
        own = [
            found["campaign"],
            choices.lens,
            *(_digest(project, path) for path in (choices.board, choices.camera) if path),
        ]
        found["campaign"] = hashlib.sha256(json.dumps([own, sum(map(bool, stated.values()))]).encode()).hexdigest()
    if choices.observe == "pixels":
        planned = stated_or_begun("plan", choices.options)
        seen = [_digest(project, path) for path in (choices.camera, choices.board, choices.fixtures) if path]
        images = {name: text for name, text in planned.items() if name in OF_IMAGES}
        found["camera"] = hashlib.sha256(json.dumps([seen, images]).encode()).hexdigest()
    robot = ""
    with suppress(OSError, TaskcalError):
        robot = robot_of(project).digest
    controller = (_digest(project, choices.kinematics), choices.nominal_controller)
    bounds = choices.options.get("correct", {})
    cell = (
        _digest(project, choices.cell),
        choices.tool,
        choices.part,
        choices.helper,
        *controller,
        *sorted(bounds.items()),
    )
    return {
        "camera": "",
        **found,
        "robot": robot,
        "header": _digest(project, LAYOUT.header),
        "task": _digest(
            project, choices.task, *(f"{LAYOUT.tasks}/{one}" for one in tables_of_task(project.path(choices.task)))
        ),
        "program": _digest(project, *read_together(project, choices.program)) if choices.program else "",
        "corrected": _digest(project, result_of(corrected_of(choices.program))) if choices.program else "",
        "cell": hashlib.sha256(json.dumps(cell).encode()).hexdigest(),
    }


def examined(project: Project) -> str:
    """Digest of what the doctor examines: robot and campaign; empty where one is missing."""
    now = contents(project)
    return now["robot"] + now["campaign"] if now["robot"] and now["campaign"] else ""


def _digest(project: Project, *paths: str) -> str:
    """Of the contents of files of a project, one behind the other; empty where the first is not there."""
    digest = hashlib.sha256()
    for number, path in enumerate(paths):
        try:
            with project.path(path).open("rb") as stream:
                digest.update(hashlib.file_digest(stream, "sha256").digest())
        except (OSError, TaskcalError):
            if number == 0:
                return ""
            digest.update(b"missing")
    return digest.hexdigest()


def made(project: Project, product: str, made_from: Mapping[str, str]) -> dict[str, Any]:
    """The content of the project's record of results, with that of a product.

    Args:
        project: whose product it is.
        product: a file that a command wrote, or was to write.
        made_from: `contents` as the command began.
    """
    known = _read_json(project, LAYOUT.made) or {}
    of = {role: made_from[role] for role in MADE_FROM[Path(product).parts[0]]}
    return {**known, product: {"product": _digest(project, product), "from": of}}


def changed_since(project: Project, product: str, now: Mapping[str, str]) -> tuple[str, ...] | None:
    """Choices that hold something else than a product was made from; None where that is not known.

    Of a calibration that was not made here, its own record of its robot is compared.
    """
    record = (_read_json(project, LAYOUT.made) or {}).get(product)
    if isinstance(record, dict) and record.get("product") == _digest(project, product):
        return tuple(role for role, digest in record["from"].items() if now[role] != digest)
    if product.startswith(f"{LAYOUT.calibrations}/"):
        provenance = (_read_json(project, product) or {}).get("provenance", {})
        return () if provenance.get("robot_digest") == now["robot"] else ("robot",)
    return None


# Where each step stands.


class StepStatus(StrEnum):
    """Where a step stands."""

    done = "done"
    needed = "needed"
    """The user has to do something."""
    outdated = "outdated"
    """What it was made from has changed."""
    overridden = "overridden"
    """It is done, in spite of what spoke against it."""
    impossible = "impossible"
    """Another step comes first."""
    optional = "optional"
    """It can be done, and nothing waits for it."""
    running = "running"


@dataclass(frozen=True, kw_only=True)
class Step:
    """A step of the road."""

    state: StepStatus
    because: tuple[str, ...] = ()
    """Choices that changed, or pages whose steps are missing."""
    waits: bool = True
    """Whether it is to be done before one goes on."""

    @property
    def open(self) -> bool:
        """Whether it is the user's turn, and what follows waits for it."""
        return self.waits and self.state in (StepStatus.needed, StepStatus.outdated, StepStatus.running)


MAX_STEM = 20
"""Characters of a task's name in that of its plan; names of RAPID modules have 28 at most."""


def plan_of(choices: Choices) -> str:
    """Path of the plan of a task; its program is a module of the same name, as RAPID lets it be."""
    of = "" if choices.observe == "tracker" else "_px"
    stem = re.sub(r"[^A-Za-z0-9]", "_", Path(choices.task).stem)[: MAX_STEM - len(of)]
    return f"{LAYOUT.plans}/m_{stem}_{stated_or_begun('plan', choices.options)['count']}{of}.csv"


CSV_PROGRAM = "_path.csv"
"""Ending of a program in CSV, beside the plan's table."""


def program_of(plan: str, language: str) -> str:
    """Path of the program that visits the poses of a plan; empty where none is written in the language."""
    suffix = next((one.composed[0] for one in languages() if one.composed and one.name == language), "")
    return plan.removesuffix(".csv") + (CSV_PROGRAM if suffix == ".csv" else suffix) if suffix else ""


def corrected_of(program: str) -> str:
    """Path of a program once it is corrected."""
    return f"{LAYOUT.corrected}/{Path(program).name}"


def report_of(calibration: str) -> str:
    """Path of the report on a calibration."""
    return f"{LAYOUT.reports}/{Path(calibration).stem}.html"


PAGES = {"robot": "robot", "measurements": "campaign", "task": "task"}
"""Pages on which choices are made that others need, with the choice."""


def steps_of(project: Project) -> Mapping[str, Step]:
    """Every step of the road by the key of its page, as the files are now.

    Raises:
        FileError: the project's own file cannot be read.
    """
    choices, now = project.choices, contents(project)
    robot, measurements, task = ((page,) if not now[role] else () for page, role in PAGES.items())
    fit = changed_since(project, choices.calibration, now) if now["calibration"] else ()
    no_fit = () if project.calibrations() else ("identify",)

    def of_product(path: str, *, there: bool, waits: bool = True, missing: tuple[str, ...] = ()) -> Step:
        own = changed_since(project, path, now) if there else ()
        changed = None if own is None or fit is None else tuple(dict.fromkeys((*fit, *own)))
        return _step(*missing, there=there, changed=changed, waits=waits)

    plan, report = plan_of(choices), report_of(choices.calibration)
    written = read_result(project, corrected_of(choices.program), "written")
    corrected = written is not None and bool(written["written"])
    verdict = written.get("verdict") if written is not None and corrected else None
    overridden = isinstance(verdict, Mapping) and bool(verdict.get("override"))
    refused = written is not None and not corrected  # that it cannot be corrected by this calibration is a result, too
    planned, reported = ((project.folder / path).is_file() for path in (plan, report))
    return {
        "robot": _step(there=not robot),
        "measurements": _step(*robot, there=not measurements and not choices.points),
        "task": _step(*robot, there=not task),
        "weight": _step(*robot, *task, there=False, waits=False),
        "plan": _step(
            *(*robot, *task),
            there=planned,
            changed=changed_since(project, plan, now) if planned else (),
            waits=bool(measurements),
        ),
        "live": _step(*robot, *task, there=False, waits=False),
        "identify": _step(*robot, *measurements, there=bool(now["calibration"]), changed=fit),
        "result": _step(*no_fit, there=bool(now["calibration"]), changed=fit, waits=False),
        "program": _with_override(
            of_product(corrected_of(choices.program), there=corrected, waits=not refused, missing=no_fit), overridden
        )
        if now["program"]
        else Step(state=StepStatus.optional, waits=False),
        "report": of_product(report, there=reported, missing=no_fit, waits=reported),
    }


def _step(*missing: str, there: bool, changed: tuple[str, ...] | None = (), waits: bool = True) -> Step:
    """A step whose result is there, made before some choices changed; None where it is not known from what it was made."""
    if missing:
        return Step(state=StepStatus.impossible, because=missing, waits=waits)
    if not there:
        return Step(state=StepStatus.needed if waits else StepStatus.optional, waits=waits)
    if changed is None or changed:
        return Step(state=StepStatus.outdated, because=changed or (), waits=waits)
    return Step(state=StepStatus.done, waits=waits)


def _with_override(step: Step, overridden: bool) -> Step:
    return replace(step, state=StepStatus.overridden) if overridden and step.state is StepStatus.done else step


def next_step(steps: Mapping[str, Step], here: str) -> str:
    """The page to go to: of the first step that is open, else the one behind this one; empty on the last."""
    pages = list(steps)
    return next((page for page, step in steps.items() if step.open), [*pages, ""][pages.index(here) + 1])
