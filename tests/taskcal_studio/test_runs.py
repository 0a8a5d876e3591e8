"""Runs of commands, with a script in place of the interpreter: progress, messages, results, and their end at any time."""

import asyncio
import os
import sys
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from taskcal.errors import TaskcalError
from taskcal_studio.project import Project
from taskcal_studio.runs import MAX_MESSAGES, CommandRun, Progress, Status, Studio

pytestmark = pytest.mark.skipif(os.name != "posix", reason="the script is one of a POSIX shell")


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Put a script of the shell in place of the interpreter."""

    def put(text: str) -> None:
        path = tmp_path / "interpreter"
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
        monkeypatch.setattr(sys, "executable", str(path))

    return put


async def ended(studio: Studio, kind: str, then: Callable[[CommandRun], Awaitable[None]] | None = None) -> CommandRun:
    run = studio.start(kind, ["fit", "a b.csv", "--json"], then)
    while run.status is Status.running:
        await asyncio.sleep(0.005)
    return run


def test_a_run_says_what_its_command_says(tmp_path: Path, script) -> None:
    script(
        """echo '{"step": "reading", "done": 0, "of": null}' >&2; echo 'error: one' >&2; echo >&2; echo 'two' >&2
        echo '{"step": "fitting", "done": 2, "of": 5}' >&2; echo '{"step": 3}' >&2
        echo "{\\"arguments\\": \\"$*\\", \\"in\\": \\"$(pwd)\\"}" """
    )
    kept = []

    async def keep(run: CommandRun) -> None:
        assert run.status is Status.running
        kept.append(run.result)

    run = asyncio.run(ended(Studio(Project(tmp_path)), "fit", keep))
    assert run.status is Status.done
    assert run.messages == ["error: one", "two", '{"step": 3}']
    assert run.progress == Progress(step="fitting", done=2, of=5)
    assert run.result == {"arguments": "-m taskcal fit a b.csv --json", "in": str(tmp_path)}
    assert kept == [run.result]
    assert run.line == "taskcal fit 'a b.csv'"


@pytest.mark.parametrize(("said", "code", "kept"), [("{}", 3, 1), ("[1]", 0, 0), ("no JSON", 1, 0), ("", 2, 0)])
def test_a_result_is_kept_where_there_is_one(tmp_path: Path, script, said: str, code: int, kept: int) -> None:
    script(f"echo '{said}'; exit {code}")
    found = []

    async def keep(run: CommandRun) -> None:
        found.append(run)

    run = asyncio.run(ended(Studio(Project(tmp_path)), "fit", keep))
    assert (run.status is Status.done, len(found), run.output) == (code == 0, kept, f"{said}\n")


def test_a_cancelled_run_ends_with_all_that_it_started(tmp_path: Path, script) -> None:
    script("trap '' TERM; (trap '' TERM; sleep 2; touch late) & touch begun; sleep 30; echo '{}'")

    async def cancel() -> CommandRun:
        studio = Studio(Project(tmp_path))
        run = studio.start("fit", ["x"])
        while not (tmp_path / "begun").exists():
            await asyncio.sleep(0.005)
        with pytest.raises(TaskcalError):
            studio.start("fit", ["y"])
        assert studio.run_of("fit") is run
        assert studio.run_of("other") is None
        await studio.close()
        while run.status is Status.running:
            await asyncio.sleep(0.005)
        return run

    run = asyncio.run(cancel())
    assert (run.status, run.result) == (Status.cancelled, None)
    time.sleep(2.0)
    assert not (tmp_path / "late").exists()


def test_a_run_that_fails_around_its_command_is_refused(tmp_path: Path, script) -> None:
    script("echo '{}'")

    async def fail(_: CommandRun) -> None:
        raise OSError("disk full")

    run = asyncio.run(ended(Studio(Project(tmp_path)), "fit", fail))
    assert (run.status, run.messages) == (Status.refused, ["error: disk full"])


def test_messages_without_end_are_cut(tmp_path: Path, script) -> None:
    script(f"i=0; while [ $i -lt {MAX_MESSAGES + 5} ]; do echo $i >&2; i=$((i+1)); done")
    run = asyncio.run(ended(Studio(Project(tmp_path)), "fit"))
    assert run.messages == [str(k) for k in range(MAX_MESSAGES)]
