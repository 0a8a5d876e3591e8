"""The command line: one subcommand per stage; each reads, makes one call and writes."""

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from taskcal.cli import (
    correct,
    doctor,
    identify,
    performance,
    plan,
    report,
    robots,
    select,
    sensitivity,
    simulate,
    study,
    validate,
    warm,
)
from taskcal.cli.output import complain
from taskcal.errors import TaskcalError

ORDER = (
    "demo", "robots", "sensitivity", "select", "plan", "study", "simulate", "identify", "validate", "performance", "correct",
    "report", "doctor", "warm",
)  # fmt: skip
"""The user's road, and then what keeps the installation in order."""


class Road(TyperGroup):
    """A group that lists its commands in the order of the user's road."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Names of the commands."""
        return sorted(self.commands, key=ORDER.index)


app = typer.Typer(
    name="taskcal",
    cls=Road,
    help="Calibrate a serial robot to the task it has to do, from a laser tracker's file.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        import taskcal

        print(f"taskcal {taskcal.__version__}")
        raise typer.Exit()


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """Options that come before a subcommand."""


@app.command(
    "demo",
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
    add_help_option=False,
    help="The whole road on a virtual robot.",
)
def run_demo(context: typer.Context) -> None:
    """Hand all arguments to the demonstration, which is imported only now."""
    from taskcal.cli.demo import demo  # pyright: ignore

    only = typer.Typer(
        add_completion=False,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    only.command()(demo)
    run: Any = typer.main.get_command(only)  # pyright: ignore
    code = run.main(args=list(context.args), prog_name="taskcal demo", standalone_mode=False)
    raise typer.Exit(code if isinstance(code, int) else 0)


app.add_typer(robots.app, name="robots")
app.command("sensitivity")(sensitivity.command)
app.command("select")(select.command)
app.command("plan")(plan.command)
app.command("study")(study.command)
app.command("simulate")(simulate.command)
app.command("identify")(identify.command)
app.command("validate")(validate.command)
app.command("performance")(performance.command)
app.command("correct")(correct.command)
app.command("report")(report.command)
app.command("warm")(warm.command)
app.command("doctor")(doctor.command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: what follows the program's name; that of this process by default.

    Returns:
        the exit status: 0, 1 where the data or a file cannot give what was asked, 2 for wrong usage.
    """
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")  # read once, when NumPy is imported; the kernels bring their own threads
    for stream in (sys.stdout, sys.stderr):
        if reconfigure := getattr(stream, "reconfigure", None):
            reconfigure(errors="replace")  # a terminal without σ or √ shows '?' instead of failing
    command: Any = typer.main.get_command(app)  # pyright: ignore
    try:
        try:
            command.main(args=arguments, prog_name="taskcal")
        finally:
            sys.stdout.flush()
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        _drop_output()
        return 1
    except TaskcalError as error:
        complain(str(error))
        return 1
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        complain(f"{where}{error.strerror or error}")
        return 1
    except Exception as error:
        if os.environ.get("TASKCAL_TRACEBACK"):
            raise
        complain(
            f"Taskcal itself failed, please report it: {type(error).__name__}: {error} "
            "(TASKCAL_TRACEBACK=1 in the environment shows where)"
        )
        return 1
    return 0


def _drop_output() -> None:
    """Nobody reads on: what is still in the buffer must not fail again when the interpreter ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
