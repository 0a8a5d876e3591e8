"""The command line: one subcommand per stage; each reads, makes one call and writes."""

import os
import sys
from collections.abc import Generator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from threading import Event
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from taskcal.cli.command import Command
from taskcal.cli.commands import (
    compare,
    convert,
    correct,
    doctor,
    export,
    identify,
    performance,
    plan,
    poses,
    register,
    report,
    robots,
    select,
    sensitivity,
    simulate,
    study,
    validate,
    warm,
)
from taskcal.cli.interrupts import prompt
from taskcal.cli.modules import import_modules
from taskcal.cli.output import MESSAGE_CHARACTERS, error, for_terminal, info
from taskcal.cli.outputs import begin_account, interrupted
from taskcal.errors import TaskcalError, shortened

ORDER = (
    "demo", "robots", "sensitivity", "select", "plan", "study", "simulate", "convert", "register", "identify", "validate",
    "compare", "performance", "correct", "poses", "export", "report", "doctor", "warm",
)  # fmt: skip
"""As the user needs them, from a robot to its report, and then what keeps the installation in order."""


INTERRUPTED = 130
"""Exit status after Ctrl-C."""


class OrderedGroup(TyperGroup):
    """A group that lists its commands in the order in which the user needs them."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Names of the commands."""
        return sorted(self.commands, key=ORDER.index)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the options before the subcommand."""
        with _fit_to_show():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Read the subcommand's options and run it."""
        with _fit_to_show():
            return super().invoke(ctx)


@contextmanager
def _fit_to_show() -> Generator[None, None, None]:
    """What is said of wrong usage repeats the argument, which may be long or command the terminal."""
    try:
        yield
    except Exception as error:
        if isinstance(message := getattr(error, "message", None), str):
            error.message = for_terminal(shortened(message, MESSAGE_CHARACTERS))  # pyright: ignore
        raise


app = typer.Typer(
    name="taskcal",
    cls=OrderedGroup,
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
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
    modules: Annotated[
        list[str] | None,
        typer.Option(
            "--import",
            metavar="MODULE",
            envvar="TASKCAL_IMPORT",
            help="Python module, or file ending in .py, with effects of your own; may be given several times.",
        ),
    ] = None,
) -> None:
    """Options that come before a subcommand."""
    if modules:
        import_modules(modules)


@app.command(
    "demo",
    cls=Command,
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
    add_help_option=False,
    help="Run the whole procedure on a virtual robot.",
)
def run_demo(context: typer.Context) -> None:
    """Hand all arguments to the demonstration, which is imported only now."""
    from taskcal.cli.commands.demo import demo  # pyright: ignore

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
app.command("sensitivity", cls=Command)(sensitivity.command)
app.command("select", cls=Command)(select.command)
app.command("plan", cls=Command)(plan.command)
app.command("study", cls=Command)(study.command)
app.command("simulate", cls=Command)(simulate.command)
app.command("convert", cls=Command)(convert.command)
app.command("register", cls=Command)(register.command)
app.command("identify", cls=Command)(identify.command)
app.command("validate", cls=Command)(validate.command)
app.command("compare", cls=Command)(compare.command)
app.command("performance", cls=Command)(performance.command)
app.command("correct", cls=Command)(correct.command)
app.command("poses", cls=Command)(poses.command)
app.command("export", cls=Command)(export.command)
app.command("report", cls=Command)(report.command)
app.command("warm", cls=Command)(warm.command)
app.command("doctor", cls=Command)(doctor.command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: what follows the program's name; that of this process by default.

    Returns:
        the exit status: 0, 1 where the data or a file cannot give what was asked or the result cannot be shown,
        2 for wrong usage, 130 where it was interrupted.
    """
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")  # read once, when NumPy is imported; the kernels bring their own threads
    if sys.stderr is None:  # pyright: ignore  # closed by the caller; Rich and others write to it unasked
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if sys.stdout is None:  # pyright: ignore
        error("standard output is closed, and the result would be lost; send it to a file or to /dev/null")
        return 1
    for stream in (sys.stdout, sys.stderr):
        if reconfigure := getattr(stream, "reconfigure", None):
            reconfigure(errors="replace")  # a terminal without σ or √ shows '?' instead of failing
    begin_account()
    with prompt(INTERRUPTED, _say_interrupted) if arguments is None else nullcontext(Event()) as said:
        status = _run(arguments)
        if status == INTERRUPTED:
            said.set()
            _say_interrupted()
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _drop_output()
        return status or 1
    except OSError as failure:
        _drop_output()
        error(f"standard output: {failure.strerror or failure}")
        return status or 1
    return status


def _say_interrupted() -> None:
    info(interrupted())


def _run(arguments: Sequence[str] | None) -> int:
    """Run a command, and say in a line what went wrong; returns the exit status."""
    command: Any = typer.main.get_command(app)  # pyright: ignore
    try:
        command.main(args=arguments, prog_name="taskcal")
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        _drop_output()
        return 1
    except TaskcalError as failure:
        error(str(failure))
        return 1
    except OSError as failure:
        where = "standard output: " if not failure.filename and _output_is_full() else ""
        error(f"{f'{failure.filename}: ' if failure.filename else where}{failure.strerror or failure}")
        return 1
    except Exception as failure:
        if os.environ.get("TASKCAL_TRACEBACK"):
            raise
        if isinstance(failure, ValueError) and "embedded null" in str(failure):
            error("a file name has a NUL character (\\x00) in it, which no file can have; correct the name")
            return 1
        error(
            f"Taskcal itself failed, please report it: {type(failure).__name__}: {failure} "
            "(TASKCAL_TRACEBACK=1 in the environment shows where)"
        )
        return 1
    return 0


def _output_is_full() -> bool:
    """Whether standard output takes no more; a line feed after what failed finds it out."""
    try:
        print(flush=True)
    except OSError:
        return True
    return False


def _drop_output() -> None:
    """Nobody reads on: what is still in the buffer must not fail again when the interpreter ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
