"""The command line: one subcommand per stage; each reads, makes one call and writes."""

import os
import sys
from collections.abc import Generator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from threading import Event
from traceback import walk_tb
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from taskcal.cli.app import INTERRUPTED, SUMMARIES, LazyCommands, import_modules, leave, prompt
from taskcal.cli.output import MESSAGE_CHARACTERS, clear_sign, error, for_terminal, info, sign_of_life
from taskcal.cli.outputs import begin_account, interrupted
from taskcal.errors import TaskcalError, shortened


class OrderedGroup(TyperGroup):
    """A group that lists its commands in the order in which the user needs them, and imports the one that is called."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands = LazyCommands()

    def list_commands(self, ctx: Any) -> list[str]:
        """Names of the commands."""
        return list(SUMMARIES)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write each command and what it does, without importing it."""
        with formatter.section("Commands"):
            formatter.write_dl(list(SUMMARIES.items()))

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
    except EOFError as failure:
        clear_sign()
        raise _cut_off(failure) from failure  # else Typer takes it for a question that got no answer: "Aborted!"
    except Exception as error:
        clear_sign()
        if isinstance(message := getattr(error, "message", None), str):
            error.message = for_terminal(shortened(message, MESSAGE_CHARACTERS))  # pyright: ignore
        raise


def _cut_off(failure: EOFError) -> Exception:
    """What a file that ends too soon is: bytecode, which Python writes without looking whether the disk had room for all of it."""
    frames = [frame for frame, _ in walk_tb(failure.__traceback__)]
    paths = [path for frame in frames if isinstance(path := frame.f_locals.get("bytecode_path"), str)]
    if not paths:
        return RuntimeError(f"EOFError: {failure}")
    return TaskcalError(
        f"{paths[-1]}: what Python compiled is cut off, as where a disk was full; remove it, it is made anew"
    )


app = typer.Typer(
    name="taskcal",
    cls=OrderedGroup,
    help="Calibrate a serial robot to the task it has to do, from a laser tracker's file.",
    no_args_is_help=True,
    rich_markup_mode=None,  # plain help keeps words whole at any width, and is there in half the time
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
    begun = sign_of_life() if arguments is None and _takes_time(sys.argv[1:]) else nullcontext()
    with prompt(_say_interrupted) if arguments is None else nullcontext(Event()) as said:
        with begun:
            status = _run(arguments)
        said.set()
    if status == INTERRUPTED:
        _say_interrupted()
        if arguments is None:
            leave()
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


def _is_an_interrupt(failure: BaseException | None) -> bool:
    """Whether Ctrl-C is behind it: Python wraps what comes while a class is made into an error of its own."""
    while failure is not None:
        if isinstance(failure, KeyboardInterrupt):
            return True
        failure = failure.__cause__ or failure.__context__
    return False


def _takes_time(arguments: Sequence[str]) -> bool:
    """Whether a command is to run, not its help or a shell's question for completions."""
    quick = {"-h", "--help", "--version", "--install-completion", "--show-completion"}
    return (
        bool(SUMMARIES.keys() & set(arguments)) and not quick & set(arguments) and "_TASKCAL_COMPLETE" not in os.environ
    )


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
        if _is_an_interrupt(failure):
            return INTERRUPTED
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
