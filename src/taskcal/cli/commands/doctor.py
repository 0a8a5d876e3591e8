"""``taskcal doctor``: what is wrong with a campaign, or whether everything that Taskcal needs is there."""

import os
import platform
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from taskcal.cli.options.common import ForceOption, JsonOption
from taskcal.cli.output import check_outputs, info, show_table, tell, write_json
from taskcal.cli.progress import bar_by_parts
from taskcal.errors import TaskcalError, UnitError

if TYPE_CHECKING:
    from taskcal.diagnosis.diagnose import Diagnosis
    from taskcal.robot.robot import Robot


@dataclass(frozen=True)
class Check:
    """One thing that was looked at."""

    name: str
    ok: bool
    found: str


def command(
    campaign: Annotated[
        Path | None,
        typer.Argument(metavar="[CAMPAIGN.csv]", readable=False, help="Measurements that may be wrong."),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option("--robot", "-r", metavar="ROBOT", help="The campaign's: a name in the catalogue, or a file."),
    ] = None,
    fix: Annotated[
        Path | None,
        typer.Option("--fix", metavar="OUT.csv", readable=False, help="Write the campaign without its mistakes here."),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Diagnose a campaign, or (without arguments) check the installation.

    Units, signs, zeros, couplings, the order of joints and rows, frames, poses, targets that slipped, a tracker that moved,
    drift, gross rows, the robot: every usual mistake is undone, singly and in pairs, and judged on rows held out.
    """
    if campaign is None:
        for option, given in (("--robot", robot), ("--fix", fix)):
            if given is not None:
                raise typer.BadParameter("give the campaign as well: taskcal doctor CAMPAIGN.csv", param_hint=option)
        _check_installation(as_json)
        return
    if robot is None:
        raise typer.BadParameter("say which robot was measured", param_hint="--robot")
    outputs = check_outputs("doctor", [("--fix", fix)], [campaign, robot], force=force)
    from taskcal.reading.writer import campaign_text
    from taskcal.robot.catalogue import load_robot

    described = load_robot(robot)
    found = diagnose_file(campaign, described)
    if found.scope:
        info(f"{campaign.name}: {found.scope}")
    if fix is not None and len(found.findings) > len(found.unmended):
        outputs.write({fix: campaign_text(found.campaign, found.robot)})
    elif fix is not None:
        info(f"{fix} is not written: there is nothing that another file would mend")
    if as_json:
        write_json({"findings": [finding.as_json() for finding in found.findings]})
    else:
        _show(found, campaign)


def _show(diagnosis: "Diagnosis", campaign: Path) -> None:
    if not diagnosis.findings:
        tell(f"{campaign}: no mistake found")
        return
    rows = [
        (
            finding.id,
            ", ".join(finding.subject[:6]) + (", …" if len(finding.subject) > 6 else ""),
            _millimetres(finding.error_before),
            _millimetres(finding.error_after),
            f"{finding.confidence:.0%}",
        )
        for finding in diagnosis.findings
    ]
    show_table("", ("finding", "of", "before mm", "after mm", "sure"), rows, left=range(2))
    for finding in diagnosis.findings:
        tell(f"{finding.id}: {finding.fix}")


def _millimetres(error: float | None) -> str:
    return "–" if error is None else f"{error * 1e3:.2f}"


def _check_installation(as_json: bool) -> None:
    checks = [_check(name, look) for name, look in _LOOKS.items()]
    healthy = all(check.ok for check in checks)
    if as_json:
        write_json({"ok": healthy, "checks": [asdict(check) for check in checks]})
    else:
        rows = [(check.name, "ok" if check.ok else "BROKEN", check.found) for check in checks]
        show_table("", ("", "", "found"), rows, left=range(3))
    if not healthy:
        raise typer.Exit(1)


def _check(name: str, look: Callable[[], str]) -> Check:
    try:
        return Check(name, True, look())
    except Exception as error:  # whatever is broken, the others are still to be looked at
        return Check(name, False, f"{type(error).__name__}: {error}")


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
    from taskcal.robot.catalogue import catalogue_names, load_robot
    from taskcal.robot.error_model import ErrorModel

    names = catalogue_names()
    if not names:
        raise RuntimeError("no robot file is installed with the package; install Taskcal again")
    sizes = [f"{name} ({len(ErrorModel(load_robot(name)))})" for name in names]
    return f"{len(names)} robots, with their parameters: {', '.join(sizes)}"


_LOOKS: dict[str, Callable[[], str]] = {
    "Python": _python,
    **{name: _package(name) for name in ("taskcal", "numpy", "scipy", "numba", "pandas", "pydantic")},
    "kernels": _kernels,
    "BLAS threads": _threads,
    "catalogue": _catalogue,
}


# What is wrong with a campaign's file, for the doctor and behind refusals.


def diagnose_file(path: Path, robot: "Robot") -> "Diagnosis":
    """The diagnosis of a file, which may lie outside the robot's limits; how far it is is shown on a terminal.

    Raises:
        FileError: it cannot be read as a campaign of so many joints.
    """
    from taskcal.diagnosis.hypotheses import open_limits
    from taskcal.reading.reader import read_campaign

    campaign = read_campaign(path, open_limits(robot))
    with bar_by_parts("looking for what is wrong") as show:
        from taskcal.diagnosis.diagnose import diagnose  # only for what could be read: it takes a second to import

        return diagnose(campaign, robot, progress=show)


def with_first_finding(refusal: TaskcalError, path: Path, robot: "Robot") -> str:
    """A refusal's message, and what mends it if the doctor knows."""
    message = str(refusal)
    if isinstance(refusal, UnitError):  # nothing else can be told before that is mended
        return message
    try:
        findings = diagnose_file(path, robot).findings
    except TaskcalError:
        return message
    first = findings[0] if findings else None
    if first is None or first.error_before is None:  # too few rows, which the refusal says
        return message
    concerned = f" of {', '.join(first.subject[:6])}" if first.subject else ""
    then = "" if first.error_after is None else f", then {first.error_after * 1e3:.1f} mm"
    return (
        f"{message}\ntaskcal doctor finds {first.id}{concerned} ({first.error_before * 1e3:.1f} mm off{then}; "
        f"{first.confidence:.0%} sure): {first.fix}"
    )
