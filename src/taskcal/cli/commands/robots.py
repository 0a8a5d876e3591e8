"""``taskcal robots``: the catalogue, one robot, and robots from files of other programs."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import typer
from typer.core import TyperGroup

import taskcal
from taskcal.analysis.identifiability import describe_combination
from taskcal.cli.command import Command, argument, laid_out, option, output_option
from taskcal.cli.options.common import ROBOT, ConventionOption
from taskcal.cli.output import info
from taskcal.cli.run import File, JsonOption, OutputOptions, Result
from taskcal.geometry import se3
from taskcal.kinematics.inverse import ALL_DIRECTIONS, freedom_of
from taskcal.report.content import Column, Facts, Section, TextTable
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.mechanism import analyse_mechanism
from taskcal.robot.robot import Part, Robot


class ShowByDefault(TyperGroup):
    """A group whose first argument, where it is not a command, is the robot to show."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Put ``show`` before a robot's name, and behind that of a command what is asked before it."""
        if args and args[0] not in self.commands and not args[0].startswith("-"):
            args = ["show", *args]
        name, command, rest = super().resolve_command(ctx, args)
        return name, command, ["--json", *rest] if ctx.params["as_json"] else rest


app = typer.Typer(
    cls=ShowByDefault,
    add_completion=False,
    rich_markup_mode=None,
    invoke_without_command=True,
    subcommand_metavar="[ROBOT | COMMAND …]",
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
@partial(laid_out, called="robots")
def catalogue(context: typer.Context, as_json: JsonOption = False) -> Result | None:
    """List the catalogue, show a robot, or import one from a table or URDF.

    taskcal robots — the catalogue

    taskcal robots ROBOT — one robot: joints, tool, mechanism, parameters

    taskcal robots import ROBOT.urdf -o ROBOT.toml — a robot of your own, from a URDF

    taskcal robots import TABLE.csv --convention dh -o ROBOT.toml — from a table

    taskcal robots task ROBOT -o TASK.toml — a task to begin with
    """
    return list_robots() if context.invoked_subcommand is None else None


@app.command("list", cls=Command)
@partial(laid_out, called="robots list")
def listed(*, as_json: JsonOption = False) -> Result:
    """List the catalogue (the word 'list' may be omitted)."""
    return list_robots()


def list_robots() -> Result:
    """The robots of the catalogue."""
    result = {"robots": [catalogue_entry(taskcal.load_robot(name)) for name in taskcal.catalogue_names()]}
    columns = (
        Column("name", "name"),
        Column("robot", "title"),
        Column("joints", "joints", "d"),
        Column("notes", lambda robot: "; ".join(robot["notes"])),
    )
    table = TextTable.of("Robots in the catalogue", columns, result["robots"])
    return Result(summary=result, sections=lambda: [Section("Robots", table)])


@app.command("show", cls=Command)
@partial(laid_out, called="robots show")
def show_robot(*, robot: str = argument(..., "ROBOT", ROBOT), as_json: JsonOption = False) -> Result:
    """Show one robot (the word 'show' may be omitted)."""
    result = describe(taskcal.load_robot(robot))
    return Result(summary=result, sections=lambda: [robot_section(result)])


@dataclass(frozen=True, kw_only=True)
class DescriptionOptions:
    """Options for reading another program's file."""

    convention: ConventionOption = None
    tip: str | None = option(None, "LINK", "Of a URDF: the tool's link; by default the end of its longest chain.")
    base: str | None = option(None, "LINK", "Of a URDF: the base link; by default its root.")
    units: str | None = option(
        None, "UNITS", "Of a table without units in its header: mm,deg or m,rad; inferred by default."
    )
    nominal: str | None = option(None, "ROBOT", "Of a UR's calibration.conf: the robot of its type, such as ur5e.")
    name: str | None = option(None, help="Name of the robot; by default the file's.")


@app.command("import", cls=Command)
@partial(laid_out, called="robots import")
def import_robot(
    *,
    source: Path = argument(
        ...,
        "FILE",
        "URDF (.urdf), xacro (.xacro), UR's kinematics (.yaml) or calibration.conf, or a table (.csv) with the columns joint, "
        "alpha_deg, a_mm, d_mm, theta_offset_deg; optionally theta_from_controller such as -(J2+J3), type, lower_deg and "
        "upper_deg.",
    ),
    output: Path = output_option(..., "ROBOT.toml", "Output: the robot file."),
    reading: DescriptionOptions,
    out: OutputOptions,
) -> Result:
    """Make a robot file from a URDF, a Denavit–Hartenberg table or a UR's calibration."""
    if output.suffix != ".toml":
        raise typer.BadParameter(f"'{output}' does not end in .toml, as robot files do", param_hint="--output")
    from taskcal.robot.catalogue import describe_robot, robot_toml

    given = {name: value for name, value in asdict(reading).items() if name != "nominal"}
    nominal = None if reading.nominal is None else taskcal.load_robot(reading.nominal)
    described = describe_robot(source, **given, nominal=nominal)
    for line in described["source"][1:]:
        info(line)
    use = (
        f"use it with --robot {output}; taskcal robots {output} shows it. Add limits, tool and tolerances to the file: the "
        "tolerances are the prior of every fit"
    )
    remark = f": {described['name']}, {len(described['joint'])} joints"
    return Result(
        summary={"robot": output, "name": described["name"], "joints": [j["name"] for j in described["joint"]]},
        sections=lambda: [Section("Robot", Facts(("next", use)))],
        files=[File("robot", output, robot_toml(described), remark)],
    )


@app.command("task", cls=Command)
@partial(laid_out, called="robots task")
def begin_task(
    *,
    robot: str = argument(..., "ROBOT", ROBOT),
    output: Path = output_option(..., "TASK.toml", "Output: the task file."),
    out: OutputOptions,
) -> Result:
    """Make a task file to begin with: a box that the robot reaches with its tool down."""
    if output.suffix != ".toml":
        raise typer.BadParameter(f"'{output}' does not end in .toml, as task files do", param_hint="--output")
    from taskcal.task.default_task import task_text

    task = taskcal.default_task(ErrorModel(taskcal.load_robot(robot)))
    assert task.workspace is not None
    center, size = (_scaled(lengths, 1e3) for lengths in (task.workspace.center, task.workspace.size))
    use = f"use it with --task {output}; change its box, orientation and accuracy to those of your task"
    return Result(
        summary={"task": output, "center_mm": center, "size_mm": size},
        sections=lambda: [Section("Task", Facts(("next", use)))],
        files=[File("task", output, task_text(task), f": a box of {' × '.join(f'{edge:g}' for edge in size)} mm")],
    )


# The description of a robot.


def catalogue_entry(robot: Robot) -> dict[str, Any]:
    """A robot in one line."""
    return {"name": robot.name, "title": robot.title, "joints": len(robot.joints), "notes": _notes(robot)}


def _notes(robot: Robot) -> list[str]:
    notes: list[str] = []
    if robot.four_bar is not None:
        notes.append("parallelogram in its drive")
    elif any(np.count_nonzero(row) > 1 for row in robot.joint_map.matrix):
        notes.append("coupled axes")
    if len(robot.joints) > 6:
        notes.append("redundant")
    if robot.driven:
        notes.append("joints driven by others")
    if any(robot.prismatic):
        notes.append("sliding joints")
    if not np.allclose(robot.T_flange_tool, np.eye(4), atol=1e-12):
        notes.append("with a tool")
    if robot.published.source:
        notes.append("parameters published")
    return notes


def describe(robot: Robot) -> dict[str, Any]:
    """A robot, its mechanism and its parameters: lengths in millimetres, angles in degrees."""
    model, mechanism = ErrorModel(robot), analyse_mechanism(robot)
    bar = robot.four_bar
    return {
        **catalogue_entry(robot),
        "source": list(robot.source),
        "joint_table": [_joint(robot, i) for i in range(len(robot.joints))],
        "tool": {"parts": [_part(part) for part in robot.tool], **_placement(robot.tool)},
        "coupled_limits": [{"of": c.text, "range_deg": _scaled(c.limits, 180 / np.pi)} for c in robot.coupled_limits],
        "four_bar": None
        if bar is None
        else {f"{key}_mm": _scaled([getattr(bar.bar, key)], 1e3)[0] for key in ("crank", "rod", "rocker", "arm")},
        "statics": _statics(robot),
        "mechanism": {
            "mobility": mechanism.mobility,
            "overconstraint": mechanism.overconstraint,
            "motorised": list(mechanism.motorised),
            "passive": list(mechanism.passive),
            "loops": mechanism.loops,
            "directions": asdict(freedom_of(model)),
            "explanation": mechanism.explanation,
        },
        "parameter_count": len(model),
        "parameters": [
            {
                "name": p.name,
                "symbol": p.symbol,
                "unit": "mm" if p.unit == "m" else "mrad",
                "tolerance": _scaled([p.tolerance], 1e3)[0],
            }
            for p in model.parameters
        ],
        "published": {"source": robot.published.source, "dropped": list(robot.published.dropped)}
        if robot.published.source
        else None,
    }


def _joint(robot: Robot, i: int) -> dict[str, Any]:
    joint, names = robot.joints[i], robot.joint_names
    slides = joint.kind == "prismatic"
    scale, unit = (1e3, "mm") if slides else (180 / np.pi, "deg")
    row, offset = robot.joint_map.matrix[i], float(robot.joint_map.offset[i]) * scale
    expression = describe_combination({names[j]: float(row[j]) for j in np.flatnonzero(row)}, {})
    if offset:
        expression += f" {'−' if offset < 0 else '+'} {abs(offset):g}{' mm' if slides else '°'}"
    if robot.four_bar is not None and robot.four_bar.output[i]:
        expression += ", through the four-bar"
    return {
        "name": joint.name,
        "kind": joint.kind,
        f"limits_{unit}": _scaled(joint.limits, scale),
        "coordinate": expression,
        "before": [_part(part) for part in joint.before],
        "after": [_part(part) for part in joint.after],
    }


def _statics(robot: Robot) -> dict[str, Any]:
    """Weights and drives that the file states; None where it states nothing."""
    known = robot.statics
    bodies = known.links or (None,) * len(robot.joints)
    return {
        "gravity": known.gravity.tolist(),
        "payload_kg": known.payload.mass,
        "payload_centre_mm": _scaled(known.payload.centre, 1e3),
        "spring_on": None if known.spring is None else robot.joint_names[known.spring.joint],
        "drives": [
            {
                "name": joint.name,
                "mass_kg": None if body is None else body.mass,
                "centre_mm": None if body is None else _scaled(body.centre, 1e3),
                "stiffness": stiffness,
                "stiffness_unit": "N/m" if joint.kind == "prismatic" else "Nm/rad",
                "gear_ratio": joint.gear_ratio,
            }
            for joint, body, stiffness in zip(robot.joints, bodies, known.stiffness, strict=True)
        ],
    }


def _scaled(values: Iterable[float], scale: float) -> list[float]:
    """Convert to the unit of a file, without rounding digits."""
    return [round(float(value) * scale, 9) for value in values]


def _part(part: Part) -> str:
    """An elementary part in words, such as ``Tx 300 (d2)`` or ``Rx −90°``."""
    if part.driven is not None:
        return f"{part.driven.name} (driven)"
    p = part.transform[:3, 3] * 1e3
    if p.any():
        axis = int(np.argmax(np.abs(p)))
        text = f"T{'xyz'[axis]} {p[axis]:g}"
    else:
        turn = np.degrees(se3.log(part.transform[:3, :3]))
        axis = int(np.argmax(np.abs(turn)))
        text = f"R{'xyz'[axis]} {turn[axis]:.6g}°"
    return (text + (f" ({part.symbol})" if part.symbol else "")).replace("-", "−")


def _placement(parts: tuple[Part, ...]) -> dict[str, Any]:
    T = np.eye(4)
    for part in parts:
        T = T @ part.transform
    return se3.placement(T)


def robot_section(sheet: Mapping[str, Any]) -> Section:
    """A description for people."""
    position = "  ".join(f"{axis} {value:g}" for axis, value in zip("xyz", sheet["tool"]["position_mm"], strict=True))
    mechanism = sheet["mechanism"]
    facts = [
        (sheet["name"], sheet["title"]),
        (
            "tool",
            f"{position} mm; {', '.join(sheet['tool']['parts'])}"
            if sheet["tool"]["parts"]
            else "none: the last joint's frame",
        ),
        *(
            ("limit", f"{c['of']} from {c['range_deg'][0]:g}° to {c['range_deg'][1]:g}°")
            for c in sheet["coupled_limits"]
        ),
    ]
    if sheet["four_bar"]:
        lengths = ", ".join(f"{key.removesuffix('_mm')} {value:g}" for key, value in sheet["four_bar"].items())
        facts.append(("four-bar", f"{lengths} mm"))
    statics = sheet["statics"]
    if statics["gravity"] != [0.0, 0.0, -1.0]:
        facts.append(("gravity", f"along {' '.join(f'{value:.3g}' for value in statics['gravity'])} of the base"))
    if statics["payload_kg"]:
        centre = " ".join(f"{value:g}" for value in statics["payload_centre_mm"])
        facts.append(("payload", f"{statics['payload_kg']:g} kg, centre at {centre} mm of the flange"))
    if statics["spring_on"]:
        facts.append(("spring", f"on {statics['spring_on']}"))
    facts += [
        ("mobility", f"{mechanism['mobility']}, overconstrained to degree {mechanism['overconstraint']}"),
        ("", mechanism["explanation"]),
        *_directions(mechanism["directions"]),
        ("parameters", str(sheet["parameter_count"])),
    ]
    if sheet["published"]:
        dropped = len(sheet["published"]["dropped"])
        facts.append(("published", f"{sheet['published']['source']} ({dropped} dropped, marked –)"))
    facts += [("source", text) for text in sheet["source"]]
    drives = TextTable.of("Weights and drives", DRIVES, statics["drives"])
    return Section(
        sheet["name"],
        Facts(*facts),
        TextTable.of("Joints", JOINTS, sheet["joint_table"]),
        drives if len(drives.header) > 1 else None,
        _tabulate_parameters(sheet),
    )


def _directions(directions: Mapping[str, int]) -> list[tuple[str, str]]:
    """What a robot of few joints cannot do to its tool; nothing of one that can do all."""
    count = sum(directions.values())
    if count == ALL_DIRECTIONS:
        return []
    return [
        (
            "directions",
            f"moves its tool in {count} of six: {directions['position']} of the position, {directions['rotation']} of the "
            "rotation; no program can take away errors in the others",
        )
    ]


def _limits(joint: Mapping[str, Any]) -> str:
    (low, high), unit = (joint["limits_mm"], " mm") if "limits_mm" in joint else (joint["limits_deg"], "°")
    return f"{low:g} … {high:g}{unit}" if np.isfinite(low) else "none stated"


JOINTS = (
    Column("joint", "name"),
    Column("kind", "kind"),
    Column("limits", _limits, "s"),
    Column("coordinate", "coordinate"),
    Column("parts before", lambda joint: ", ".join(joint["before"])),
    Column("parts after", lambda joint: ", ".join(joint["after"])),
)

DRIVES = (
    Column("joint", "name"),
    Column("mass kg", "mass_kg", "g", optional=True),
    Column(
        "centre mm", lambda d: d["centre_mm"] and " ".join(f"{value:g}" for value in d["centre_mm"]), "s", optional=True
    ),
    Column("stiffness", lambda d: d["stiffness"] and f"{d['stiffness']:g} {d['stiffness_unit']}", "s", optional=True),
    Column("gear ratio", "gear_ratio", "g", optional=True),
)
"""Masses, stiffness and gear ratios, each if any is stated."""


def _tabulate_parameters(sheet: Mapping[str, Any]) -> TextTable:
    """A row for each frame, with the publication's symbol behind each parameter."""
    dropped = set(sheet["published"]["dropped"]) if sheet["published"] else set[str]()
    frames: dict[str, list[str]] = {}
    tolerances: dict[str, dict[str, None]] = {}
    for p in sheet["parameters"]:
        frame, component = p["name"].split(".", 1)
        symbol = f" {p['symbol']}" if p["symbol"] else ""
        frames.setdefault(frame, []).append(f"{'–' if p['name'] in dropped else ''}{component}{symbol}")
        tolerances.setdefault(frame, {})[f"{p['tolerance']:g} {p['unit']}"] = None
    width = max(map(len, frames.values()))
    columns = (
        Column("frame", lambda frame: frame),
        *(Column("", lambda frame, k=k: frames[frame][k] if k < len(frames[frame]) else "") for k in range(width)),
        Column("tolerance (1σ)", lambda frame: ", ".join(tolerances[frame])),
    )
    return TextTable.of("Parameters", columns, list(frames))
