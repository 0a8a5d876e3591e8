"""``taskcal doctor``: the diagnosis of a campaign, or a check of the installation."""

import math
import os
import platform
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import typer

import taskcal
from taskcal.cli.command import argument, option
from taskcal.cli.options.campaign import TableOptions
from taskcal.cli.options.common import robot_option
from taskcal.cli.output import info
from taskcal.cli.progress import bar_by_parts
from taskcal.cli.run import File, OutputOptions, Result
from taskcal.errors import OpenFrameError, TaskcalError, UnitError
from taskcal.report.content import Column, Facts, Section, TextTable
from taskcal.report.diagnosis import campaign_section, findings_table, name_subjects
from taskcal_groundwork.options import options_of


def command(
    *,
    campaign: list[Path] | None = argument(
        None, "[CAMPAIGN.csv…]", "Measurements to diagnose; of several files each is a station of the tracker."
    ),
    robot: str | None = robot_option("The campaign's robot: catalogue name, or file."),
    fix: Path | None = option(None, "OUT.csv", "Output CSV: the campaign with the mistakes fixed.", writes="new"),
    reading: TableOptions,
    out: OutputOptions,
) -> Result:
    """Diagnose a campaign, or (without arguments) check the installation.

    Tests the usual mistakes, one by one and in pairs, on held-out rows: units, signs, zeros, couplings, the order of joints and
    rows, frames, poses, targets that slipped, a tracker that moved, drift, gross errors, the robot.
    """
    if not campaign:
        stated = [(f"--{one.name}", getattr(reading, one.field) != one.default) for one in options_of(type(reading))]
        for name, given in (("--robot", robot is not None), ("--fix", fix is not None), *stated):
            if given:
                raise typer.BadParameter("give the campaign as well: taskcal doctor CAMPAIGN.csv", param_hint=name)
        return _installation()
    if robot is None:
        raise typer.BadParameter("--robot is required with a campaign", param_hint="--robot")
    from taskcal.reading.writer import campaign_text

    found = diagnose_file(campaign, taskcal.load_robot(robot), reading.read_options)
    for note in found.campaign.notes:
        info(f"{found.campaign.source}: {note}")
    if found.scope:
        info(f"{', '.join(path.name for path in campaign)}: {found.scope}")
    if fix is not None:
        for line in _fixed(found, fix):
            info(line)
    return Result(
        summary={"findings": [finding.as_json() for finding in found.findings]},
        sections=lambda: _sections(found, " ".join(map(str, campaign))),
        files=[File("fixed", fix, campaign_text(found.campaign, found.robot))] if fix and found.mends else (),
    )


def _fixed(found: "taskcal.diagnosis.Diagnosis", fix: Path) -> Iterator[str]:
    """What ``--fix`` did, a line for each finding, and what that does to rows held out."""
    from taskcal.diagnosis.hypotheses import MISTAKES

    for finding in found.findings:
        named = f"{finding.id}{' of ' if finding.subject else ''}{name_subjects(finding.subject)}"
        if finding in found.mends:
            robot = MISTAKES[finding.id].part == "robot"
            yield f"applied: {named}{', the file is for that robot' if robot else ''}"
        elif finding.alternative:
            yield f"not applied: {named}, which explains the campaign in place of the others"
        else:
            yield f"not applied: {named}, which no change of the file mends"
    if not found.mends:
        yield f"{fix} is not written: {'no finding can be fixed in a file' if found.findings else 'no mistake found'}"
    elif found.held_out is not None:
        before, after = (f"{one * 1e3:.3f}" if math.isfinite(one) else "–" for one in found.held_out)
        yield f"error of rows held out, the geometry free within its tolerances: {before} mm as given, {after} mm fixed"


MAX_USEFUL_RATIO = 0.99
"""Ratio of the error if fixed to the error, up to which a finding is a hint: one that changes nothing is not the cause."""


def _sections(diagnosis: "taskcal.diagnosis.Diagnosis", campaign: str) -> list[Section]:
    found = Section(
        "Diagnosis",
        None if diagnosis.findings else f"{campaign}: no mistake found",
        findings_table([finding.as_json() for finding in diagnosis.findings]),
        Facts(*((finding.id, finding.fix) for finding in diagnosis.findings)),
    )
    return [campaign_section(diagnosis.campaign), found]


def diagnose_file(
    path: Path | Sequence[Path], robot: "taskcal.Robot", options: "taskcal.reading.ReadOptions | None" = None
) -> "taskcal.diagnosis.Diagnosis":
    """The diagnosis of a file or of several stations' files, which may be outside the robot's limits, with progress on a terminal.

    Raises:
        FileError: it cannot be read as a campaign of so many joints.
    """
    from taskcal.diagnosis.hypotheses import open_limits

    options = replace(options or taskcal.reading.ReadOptions(), judged=False, counted_by=robot)
    campaign = taskcal.read_campaign(path, open_limits(robot), options=options)
    with bar_by_parts("testing the usual mistakes") as progress:
        return taskcal.diagnose(campaign, robot, progress=progress)


def with_first_finding(
    refusal: TaskcalError,
    path: Sequence[Path],
    robot: "taskcal.Robot",
    options: "taskcal.reading.ReadOptions | None" = None,
) -> str:
    """A refusal's message, with the doctor's first finding if it reduces the error."""
    message = str(refusal)
    # units have to be right before anything else can be tested, and rows that determine no frame test nothing
    if isinstance(refusal, UnitError | OpenFrameError):
        return message
    try:
        findings = diagnose_file(path, robot, options).findings
    except TaskcalError:
        return message
    first = findings[0] if findings else None
    if first is None or first.error_before is None:  # too few rows, which the refusal states
        return message
    before, after = first.error_before * 1e3, None if first.error_after is None else first.error_after * 1e3
    if after is not None and after > MAX_USEFUL_RATIO * before:
        return message
    subject = f" of {name_subjects(first.subject)}" if first.subject else ""
    change = f"{before:.1f}" if after is None else f"{before:.1f} → {after:.1f}"
    return f"{message}\nhint: {first.id}{subject} (error {change} mm, confidence {first.confidence:.0%}): {first.fix}"


# The installation.


def _installation() -> Result:
    checks = [{"name": name, **_check(look)} for name, look in _LOOKS.items()]
    healthy = all(check["ok"] for check in checks)
    columns = (
        Column("", "name"),
        Column("", lambda check: "ok" if check["ok"] else "BROKEN"),
        Column("found", "found"),
    )
    table = TextTable.of("", columns, checks)
    return Result(
        summary={"ok": healthy, "checks": checks},
        sections=lambda: [Section("Installation", table)],
        failed=not healthy,
    )


def _check(look: Callable[[], str]) -> dict[str, bool | str]:
    try:
        return {"ok": True, "found": look()}
    except Exception as error:  # whatever is broken, the others are still to be checked
        return {"ok": False, "found": f"{type(error).__name__}: {error}"}


def _python() -> str:
    return f"{platform.python_version()} on {platform.system()} {platform.machine()}"


def _package(name: str) -> Callable[[], str]:
    def look() -> str:
        import_module(name)
        return version(name)

    return look


def _kernels() -> str:
    from taskcal.kernels.kernel_cache import cache_folder, is_warm

    return f"{cache_folder()} ({'warm' if is_warm() else 'not compiled yet: taskcal warm'})"


def _threads() -> str:
    variables = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    return ", ".join(f"{name.removesuffix('_NUM_THREADS')} {os.environ.get(name, 'not set')}" for name in variables)


def _catalogue() -> str:

    names = taskcal.catalogue_names()
    if not names:
        raise RuntimeError("no robot file is installed with the package; install Taskcal again")
    sizes = [f"{name} ({len(taskcal.ErrorModel(taskcal.load_robot(name)))})" for name in names]
    return f"{len(names)} robots, with their parameters: {', '.join(sizes)}"


def _robot_programs() -> str:
    """Taskcal brings the library; the package that has it alone would lie over it."""
    try:
        alone = version("robot-programs")
    except PackageNotFoundError:
        return "of Taskcal's own wheel"
    raise RuntimeError(
        f"the package robot-programs {alone} lies over Taskcal's own copy; uninstall it, then install Taskcal again"
    )


_LOOKS: dict[str, Callable[[], str]] = {
    "Python": _python,
    **{name: _package(name) for name in ("taskcal", "numpy", "scipy", "numba", "pydantic")},
    "robot_programs": _robot_programs,
    "kernels": _kernels,
    "BLAS threads": _threads,
    "catalogue": _catalogue,
}
