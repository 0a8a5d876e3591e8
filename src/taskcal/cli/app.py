"""The command line: its commands, each imported when it is called, and how a run of one ends."""

import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Generator, Iterator, MutableMapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from importlib import import_module
from pathlib import Path
from traceback import walk_tb
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from taskcal.cli.command import Command, laid_out
from taskcal.cli.output import MESSAGE_CHARACTERS, error, for_terminal, info
from taskcal.cli.progress import clear_line, working
from taskcal.cli.run import begin_account, interrupted
from taskcal.errors import TaskcalError, shortened

SUMMARIES = {
    "demo": "Run the published procedure on a simulated robot.",
    "robots": "List the catalogue, show a robot, or import one from a table or URDF.",
    "sensitivity": "Report parameter sensitivity and identifiability.",
    "select": "Select the smallest set of parameters that meets a task's accuracy.",
    "plan": "Plan measurement poses that minimise the expected task error.",
    "measure": "Measure live: choose each pose by what was measured so far, until the tolerance is proven.",
    "study": "Predict the task error after calibration, by simulating many robots.",
    "simulate": "Simulate a campaign of a simulated robot drawn from its tolerances.",
    "board": "Print calibration boards at true scale, with a ruler.",
    "convert": "Convert a file of measurements to plain CSV or Parquet.",
    "register": "Register tracker frame and targets with the nominal robot.",
    "identify": "Identify a robot's parameters, tracker frame and targets from a campaign.",
    "validate": "Validate a calibration against a campaign; optional pass/fail decision.",
    "compare": "Compare calibrations of one robot, or a model with a calibration.",
    "fleet": "Monitor a fleet: latest calibrations, changes and outliers.",
    "performance": "Evaluate accuracy and repeatability of poses or paths (ISO 9283).",
    "correct": "Correct a robot program with the calibrated model.",
    "place": "Compare placements of a part by the expected error.",
    "poses": "Compute tool poses from joint values, or joint values from tool poses.",
    "export": "Export a calibrated robot, or fit the offsets of a controller.",
    "report": "Write an HTML report of a calibration.",
    "studio": "Open the browser interface on a project folder.",
    "doctor": "Diagnose a campaign, or (without arguments) check the installation.",
    "warm": "Compile all kernels ahead of their first use.",
}
"""Each command's name and the first line of its help, in the order in which a user needs them: from a robot to its report, and
then what keeps the installation in order."""

EXAMPLES = {
    "demo": "taskcal demo",
    "robots list": "taskcal robots",
    "robots show": "taskcal robots show abb-irb120",
    "robots import": "taskcal robots import table.csv --convention dh -o my-robot.toml",
    "robots task": "taskcal robots task ur5e -o task.toml",
    "sensitivity": "taskcal sensitivity --robot ur5e --task task.toml",
    "select": "taskcal select --robot ur5e --task task.toml",
    "plan": "taskcal plan --robot ur5e --task task.toml --count 40 -o plan.csv",
    "measure": "taskcal measure -r ur5e -t task.toml -c virtual -i virtual -o out.csv",
    "study": "taskcal study --robot ur5e --task task.toml --counts 20,40",
    "simulate": "taskcal simulate --robot ur5e --task task.toml -o campaign.csv",
    "board": "taskcal board board.toml -o board.pdf",
    "convert": "taskcal convert --robot ur5e measured.xlsx -o campaign.csv",
    "register": "taskcal register --robot ur5e campaign.csv -o reg.json",
    "identify": "taskcal identify --robot ur5e campaign.csv -o cal.json --holdout 0.3",
    "validate": "taskcal validate cal.json other.csv --accept 0.15",
    "compare": "taskcal compare before.json after.json --task task.toml",
    "fleet": "taskcal fleet robots/",
    "performance": "taskcal performance poses.csv",
    "correct": "taskcal correct -c cal.json part.mod -o part-corrected.mod",
    "place": "taskcal place -c cal.json part.mod --region=-300:300,0,0",
    "poses": "taskcal poses -c cal.json joints.csv",
    "export": "taskcal export cal.json --form urdf -o robot.urdf",
    "report": "taskcal report cal.json --task task.toml -o report.html",
    "studio": "taskcal studio my-project",
    "doctor": "taskcal doctor campaign.csv --robot ur5e",
    "warm": "taskcal warm",
}
"""A use of each command that needs no other option; its help shows it."""


ELSEWHERE = {"studio": "taskcal_studio.command"}
"""Modules of commands that run others, and read what these declare."""


class LazyCommands(MutableMapping[str, Any]):
    """Commands by name; a value is imported as it is asked for."""

    def __init__(self) -> None:
        self._loaded: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in SUMMARIES:
            raise KeyError(name)
        if name not in self._loaded:
            self._loaded[name] = _load(name)
        return self._loaded[name]

    def __setitem__(self, name: str, command: Any) -> None:
        self._loaded[name] = command

    def __delitem__(self, name: str) -> None:
        del self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter(SUMMARIES)

    def __len__(self) -> int:
        return len(SUMMARIES)


def _load(name: str) -> Any:
    """The command of a name, from its module."""
    module = import_module(ELSEWHERE.get(name, f"taskcal.cli.commands.{name}"))
    app = getattr(module, "app", None)
    if app is None:
        app = typer.Typer(add_completion=False, rich_markup_mode=None)
        app.command(name, cls=Command)(laid_out(module.command, name))
    command: Any = typer.main.get_command(app)  # pyright: ignore
    command.name = name
    command.example = EXAMPLES.get(name, "")
    for inner, subcommand in getattr(command, "commands", {}).items():
        subcommand.example = EXAMPLES.get(f"{name} {inner}", "")
    return command


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
        with _readable():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Read the subcommand's options and run it."""
        with _readable():
            return super().invoke(ctx)


@contextmanager
def _readable() -> Generator[None, None, None]:
    """Make messages of wrong usage safe to print: they repeat the argument, which may be long or command the terminal."""
    try:
        yield
    except EOFError as failure:
        clear_line()
        raise _cut_off(failure) from failure  # else Typer takes it for a question that got no answer: "Aborted!"
    except Exception as error:
        clear_line()
        if isinstance(message := getattr(error, "message", None), str):
            error.message = for_terminal(shortened(message, MESSAGE_CHARACTERS))  # pyright: ignore
        raise


def _cut_off(failure: EOFError) -> Exception:
    """The error of a file that ends too soon: bytecode, which Python writes without checking that the disk had room for it."""
    frames = [frame for frame, _ in walk_tb(failure.__traceback__)]
    paths = [path for frame in frames if isinstance(path := frame.f_locals.get("bytecode_path"), str)]
    if not paths:
        return RuntimeError(f"EOFError: {failure}")
    return TaskcalError(
        f"{paths[-1]}: compiled Python file is truncated, as on a full disk; remove it, Python writes it again"
    )


app = typer.Typer(
    name="taskcal",
    cls=OrderedGroup,
    help="Calibrate serial robots from laser-tracker measurements.",
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
    os.environ.setdefault("NUMBA_OPT", "1")  # kernels run as fast as with 3, and compile in three quarters of the time
    if sys.stderr is None:  # pyright: ignore  # closed by the caller; Rich and others write to it unasked
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if sys.stdout is None:  # pyright: ignore
        error("standard output is closed, and the result would be lost; send it to a file or to /dev/null")
        return 1
    for stream in (sys.stdout, sys.stderr):
        if reconfigure := getattr(stream, "reconfigure", None):
            reconfigure(errors="replace")  # a terminal without σ or √ shows '?' instead of failing
    begin_account()
    begun = working() if arguments is None and _takes_time(sys.argv[1:]) else nullcontext()
    with watch_for_interrupt(_say_interrupted) if arguments is None else nullcontext(threading.Event()) as said:
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
    """Discard the buffer, which nobody reads: it must not fail again when the interpreter ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


# Ctrl-C ends the program within a second, whatever it is doing.

INTERRUPTED = 130
"""Exit status after Ctrl-C."""

GRACE_S = 0.5
"""Time that the main thread has to end by itself: with it, Ctrl-C ends within a second."""


@contextmanager
def watch_for_interrupt(say: Callable[[], None]) -> Generator[threading.Event, None, None]:
    """Watch for an interrupt beside the main thread, which may be in a library that does not return or swallows it.

    Yields an event: once set, the end is no longer said. An interrupt that a library's callback loses is not shown either.
    """
    said = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield said
        return
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    earlier = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_wait, args=(reader, say, said), daemon=True).start()
    shown = sys.unraisablehook
    sys.unraisablehook = lambda lost: None if issubclass(lost.exc_type, KeyboardInterrupt) else shown(lost)
    try:
        yield said
    finally:
        sys.unraisablehook = shown
        said.set()  # by whoever called: this thread is on its way out
        signal.set_wakeup_fd(earlier)
        writer.close()


def leave() -> NoReturn:
    """End the process without what libraries do at its end: they wait for processes and threads of theirs."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(INTERRUPTED)


def _wait(reader: socket.socket, say: Callable[[], None], said: threading.Event) -> None:
    while number := reader.recv(1):
        if number[0] == signal.SIGINT:
            break
    else:
        return
    threading.Event().wait(GRACE_S)  # not in vain where the program has ended: it may wait for threads of a library
    if not said.is_set():
        with suppress(OSError):
            say()
    os._exit(INTERRUPTED)


# Modules that bring effects of one's own, named before the command: ``taskcal --import my_effects identify …``.

OPTION = "--import"


def import_modules(names: list[str]) -> None:
    """Import modules by name, or files that end in ``.py``.

    Only what the user names is run, never what a calibration names. A file's folder is searched last, so that nothing in it
    stands in for a module that Python knows.

    Raises:
        typer.BadParameter: there is no such module or file, another module has its name, or it fails.
    """
    for name in names:
        path = Path(name) if name.endswith(".py") else None
        if path is not None:
            if not path.is_file():
                raise typer.BadParameter(f"there is no file {name}", param_hint=OPTION)
            sys.path.append(str(path.resolve().parent))
        module_name = name if path is None else path.stem
        try:
            module = import_module(module_name)
        except ModuleNotFoundError as error:
            if error.name != module_name:
                raise typer.BadParameter(
                    f"{name} imports {error.name}, which is not installed", param_hint=OPTION
                ) from error
            raise typer.BadParameter(
                f"there is no module {name}; install it, or give its file, such as {name}.py", param_hint=OPTION
            ) from error
        except Exception as error:
            raise typer.BadParameter(f"{name} fails: {type(error).__name__}: {error}", param_hint=OPTION) from error
        if path is not None and (module.__file__ is None or Path(module.__file__).resolve() != path.resolve()):
            raise typer.BadParameter(
                f"another module is called {path.stem} ({module.__file__ or 'built in'}); rename the file",
                param_hint=OPTION,
            )
