"""Start-up, help and the outermost errors, in processes of their own."""

import os
import subprocess
import sys
from pathlib import Path
from pkgutil import iter_modules

import pytest

import taskcal
from taskcal.cli import main
from taskcal.cli.output import started_as
from tests.cli.conftest import IRB6660, Run
from tests.faults.uncovered import uncovered_environment

HEAVY = ("numpy", "scipy", "numba", "pandas", "jaxtyping")

COMMANDS = [
    ["robots"], ["robots", "import"], ["sensitivity"], ["select"], ["plan"], ["study"], ["simulate"], ["identify"], ["validate"],
    ["compare"], ["performance"], ["register"],
    ["report"], ["warm"], ["doctor"],
]  # fmt: skip


def python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, env={**os.environ, **environment}
    )


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; from taskcal.cli import main; status = main(['--help']); "
        f"print([m for m in {HEAVY!r} if m in sys.modules], file=sys.stderr); sys.exit(status)"
    )
    ended = python(code)
    assert ended.returncode == 0
    assert ended.stderr.strip() == "[]"
    assert "identify" in ended.stdout


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_command_has_help(run: Run, command: list[str]) -> None:
    ended = run(*command, "--help")
    assert ended.status == 0
    assert "--json" in ended.out
    assert ended.err == ""


def test_the_commands_stand_in_the_order_of_the_road(run: Run) -> None:
    text = run("--help").out
    places = [
        text.index(f"\n  {name} ")
        for name in ("demo", "robots", "sensitivity", "plan", "study", "simulate", "identify")
    ]
    assert places == sorted(places)


def test_version(run: Run) -> None:
    ended = run("--version")
    assert (ended.status, ended.out) == (0, f"taskcal {taskcal.__version__}\n")


def test_blas_threads_are_set_before_numpy_is_imported() -> None:
    code = (
        "import os, sys; from taskcal.cli import main; assert 'numpy' not in sys.modules; main(['--version']); "
        "print(os.environ['OPENBLAS_NUM_THREADS'], os.environ['OMP_NUM_THREADS'], os.environ['MKL_NUM_THREADS'])"
    )
    kept = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={**kept, "OMP_NUM_THREADS": "2"}
    )
    assert ended.stdout.splitlines()[-1] == "1 2 1"


def test_run_as_a_module_the_status_is_that_of_the_command() -> None:
    ended = [
        subprocess.run([sys.executable, "-m", "taskcal", *arguments], capture_output=True, check=False).returncode
        for arguments in (["--version"], ["robots", "no-such-robot"], ["no-such-command"])
    ]
    assert ended == [0, 1, 2]


@pytest.mark.parametrize(
    "arguments", [["nothing"], ["identify"], ["robots", "--nothing"], ["simulate", "--count", "0"]]
)
def test_wrong_usage_is_2(run: Run, arguments: list[str]) -> None:
    ended = run(*arguments)
    assert ended.status == 2
    assert ended.out == ""
    assert ended.err


def test_an_interrupt_is_130(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("taskcal.robot.catalogue.load_robot", interrupt)
    ended = run("robots", "ur5")
    assert (ended.status, ended.out) == (130, "")


def test_a_fault_of_our_own_is_said_in_one_line(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("nothing to divide by")

    monkeypatch.setattr("taskcal.robot.catalogue.load_robot", fail)
    ended = run("robots", "ur5")
    assert ended.status == 1
    assert "ZeroDivisionError: nothing to divide by" in ended.err
    monkeypatch.setenv("TASKCAL_TRACEBACK", "1")
    with pytest.raises(ZeroDivisionError):
        main(["robots", "ur5"])


def test_a_reader_that_leaves_early_is_no_error() -> None:
    code = "import sys; from taskcal.cli import main; sys.exit(main(['robots', '--json']))"
    read, write = os.pipe()
    os.close(read)
    ended = subprocess.run([sys.executable, "-c", code], stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert ended.stderr == ""
    assert ended.returncode == 1


def shell(line: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", "-c", f"{sys.executable} -m taskcal {line}"], capture_output=True, text=True, check=False
    )


def test_a_closed_standard_output_is_said_in_a_line() -> None:
    ended = shell("robots >&-")
    assert ended.returncode == 1
    assert ended.stderr.startswith("error: standard output is closed")
    assert ended.stderr.count("\n") == 1


def test_a_closed_standard_error_does_not_matter() -> None:
    ended = shell("robots --json 2>&-")
    assert (ended.returncode, ended.stdout[0]) == (0, "{")
    assert shell("robots none 2>&-").returncode == 1


@pytest.mark.parametrize("command", ["robots", "robots --json", "--version"])
def test_a_full_standard_output_is_said_in_a_line(command: str, tmp_path: Path) -> None:
    """No file may grow: what any system of the POSIX family does when a disk or a quota is full."""
    ended = subprocess.run(
        ["sh", "-c", f"ulimit -f 0; {sys.executable} -m taskcal {command} >{tmp_path / 'out'}"],
        capture_output=True,
        text=True,
        check=False,
        env=uncovered_environment(),
    )
    assert ended.returncode == 1
    assert ended.stderr == "error: standard output: File too large\n"


@pytest.mark.parametrize(
    "arguments", [["robots", "a\0b.toml"], ["report", "a\0b.json"], ["identify", "a\0", "-o", "b\0"]]
)
def test_a_nul_in_a_path_is_refused_in_a_line(run: Run, arguments: list[str]) -> None:
    ended = run(*arguments, *(["--robot", "ur5"] if arguments[0] == "identify" else []))
    assert ended.status in (1, 2)
    assert "\0" not in ended.err
    assert "itself failed" not in ended.err


@pytest.mark.parametrize(
    "arguments",
    [
        ["robots", "ur\x1b[31m\x07"],
        ["no\x1b[31m\x07"],
        ["--no\x1b[31m\x07"],
        ["report", "a\x1b[31m\x07.json"],
        ["robots", "import", "a.csv", "--convention", "d\x1b[31m\x07h", "-o", "b.toml"],
    ],
)
def test_control_characters_in_arguments_are_escaped(run: Run, arguments: list[str]) -> None:
    """Control characters of an argument do not reach the terminal."""
    ended = run(*arguments)
    assert ended.status != 0
    assert not set("\x1b\x07") & set(ended.out + ended.err)
    assert "\\x1b[31m\\x07" in ended.err.replace("\n", "").replace("│", "").replace(" ", "")


def test_control_characters_of_a_file_do_not_reach_the_terminal(run: Run, tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    table.write_text("joint,alpha_deg,a_mm,d_mm,theta_offset_deg\nJ1,0,500,0,0\nJ2,90,300,200,0\n")
    assert run("robots", "import", table, "--convention", "dh", "-o", tmp_path / "r.toml").status == 0
    described = (tmp_path / "r.toml").read_text()
    title = 'title = "cell\\u001b[2J\\u0007\\u009b2J"\n'
    (tmp_path / "r.toml").write_text(title + described)
    for options in ([], ["--json"]):
        ended = run("robots", tmp_path / "r.toml", *options)
        assert ended.status == 0, ended.err
        assert not set("\x1b\x07\x9b") & set(ended.out)
        assert "2J" in ended.out


@pytest.mark.parametrize("command", [["robots"], ["report"], ["no"], ["plan", "--count"]])
def test_a_message_does_not_repeat_an_argument_of_any_length(run: Run, command: list[str]) -> None:
    ended = run(*command[:-1], command[-1] + "x" * 1_000_000) if command == ["no"] else run(*command, "x" * 1_000_000)
    assert ended.status != 0
    assert len(ended.err) < 10_000


@pytest.mark.long
def test_compilation_is_announced_on_stderr_only_if_needed(tmp_path: Path, cell: Path) -> None:
    """With a cache of its own; by a command that never fits, twice."""
    asked = ["sensitivity", "--robot", IRB6660, "--campaign", str(cell / "one.csv"), "--json"]
    code = f"import sys; from taskcal.cli import main; sys.exit(main({asked!r}))"
    first, second = (python(code, NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2))
    assert (first.returncode, second.returncode) == (0, 0)
    assert first.stderr == "compiling kernels, once: some seconds\n"
    assert second.stderr == ""
    assert first.stdout == second.stdout
    assert first.stdout.startswith("{")


def test_every_command_is_listed_with_the_first_line_of_its_help() -> None:
    from taskcal.cli import commands
    from taskcal.cli.app import ELSEWHERE, SUMMARIES, LazyCommands

    assert {module.name for module in iter_modules(commands.__path__)} | set(ELSEWHERE) == set(SUMMARIES)
    for name, command in LazyCommands().items():
        assert command.name == name
        if name != "robots":
            assert " ".join(command.help.split("\n\n")[0].split()) == SUMMARIES[name]


@pytest.mark.parametrize(
    ("started", "printed"),
    [(".venv/bin/taskcal", ".venv/bin/taskcal"), ("my folder/taskcal", "'my folder/taskcal'"), ("-c", "taskcal")],
)
def test_hints_call_the_program_as_it_was_called(monkeypatch: pytest.MonkeyPatch, started: str, printed: str) -> None:
    monkeypatch.setattr(sys, "argv", [started])
    assert started_as() == printed


def test_hints_are_bare_where_the_shell_finds_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "taskcal"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "argv", [str(program)])
    assert started_as() == "taskcal"


@pytest.mark.long
def test_warm_compiles_everything_that_other_commands_need(cell: Path, tmp_path: Path) -> None:
    """With a cache of its own: after `warm`, no command leaves another kernel."""
    script = (
        "import sys; from taskcal.cli import main; from taskcal.kernels.kernel_cache import cache_folder; "
        "count = lambda: len(list(cache_folder().rglob('*.nbc'))); "
        "assert main(['warm', '--json']) == 0; first = count(); "
        f"c = {str(cell)!r}; o = {str(tmp_path / 'out')!r}; robot = ['--robot', {IRB6660!r}]; "
        "assert first > 0; "
        "assert main(['sensitivity', *robot, '--task', c + '/task.toml', '--json']) == 0; "
        "assert main(['simulate', *robot, '--task', c + '/task.toml', '-o', o + '.csv']) == 0; "
        "assert main(['identify', *robot, c + '/three.csv', '-o', o + '.json', '--keep', 'J2,J3']) == 0; "
        "assert main(['identify', *robot, c + '/poses.csv', '-o', o + '.json']) == 0; "
        "assert main(['validate', o + '.json', c + '/poses.csv', '--reregister']) == 0; "
        "few = ['--count', '8', '--candidates', '50', '--model-error-mm', '0.02']; "
        "assert main(['plan', *robot, '--task', c + '/list.toml', *few, '-o', o + '-plan.csv']) == 0; "
        "assert main(['report', o + '.json', '--task', c + '/list.toml', '-o', o + '.html']) == 0; "
        "assert main(['correct', '-c', o + '.json', c + '/path.csv', '-o', o + '-path.csv', '--accept-uncertain']) == 0; "
        "print(count() - first, file=sys.stderr)"
    )
    (cell / "path.csv").write_text("J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg\n0,10,20,5,-40,10\n3,12,22,6,-42,12\n")
    ended = python(script, NUMBA_CACHE_DIR=str(tmp_path / "kernels"))
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr.splitlines()[0].startswith("compiling kernels")
    assert ended.stderr.splitlines()[-1] == "0"
