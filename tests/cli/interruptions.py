"""Ctrl-C at moments drawn over the whole run of a command: ``python -m tests.cli.interruptions [COMMAND …] [--times 5]``.

An experiment of many minutes, not a test; a sample of it is in the tests. Each command runs in a process of its own. Said are the
moment, how long the end took, and what was wrong with it.
"""

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from argparse import ArgumentParser
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

TASK = """
name = "box"
[workspace]
frame = "base"
shape = "box"
center_mm = [350.0, 0.0, 350.0]
size_mm = [200.0, 200.0, 150.0]
[[workspace.orientation]]
quaternion = [0.0, 0.955, 0.0, 0.296]
[accuracy]
position_mm = 0.1
"""

ROBOT = "--robot abb-irb120"
COMMANDS = {
    "identify": f"identify {ROBOT} c.csv -o new.json",
    "effects": f"identify {ROBOT} c.csv -o new.json --effects auto",
    "folds": f"identify {ROBOT} c.csv -o new.json --folds 5",
    "simulate": f"simulate {ROBOT} --task task.toml -o new.csv --truth truth.json",
    "plan": f"plan {ROBOT} --task task.toml --count 30 -o plan.csv --report plan.html",
    "study": f"study {ROBOT} --task task.toml --robots 24 --counts 20 --workers 2 -o rows.csv --report study.html",
    "select": f"select {ROBOT} --task task.toml --campaign c.csv --report select.html",
    "sensitivity": f"sensitivity {ROBOT} --task task.toml --report sensitivity.html",
    "correct": "correct -c cal.json path.csv -o new.csv --accept-uncertain --report new.html",
    "place": "place -c cal.json path.csv --region=-50:50,-50:50,0 -o map.csv",
    "doctor": f"doctor {ROBOT} wrong.csv --fix fixed.csv",
    "report": "report cal.json --task task.toml -o new.html --campaign c.csv",
    "validate": "validate cal.json c.csv",
    "import": "robots import table.csv --convention dh -o new.toml",
    "convert": f"convert {ROBOT} c.csv -o new.csv",
    "parquet": f"convert {ROBOT} c.csv -o new.parquet",
    "export": "export cal.json --form urdf -o new.urdf",
    "register": f"register {ROBOT} c.csv -o new.json",
    "poses": f"poses {ROBOT} joints.csv -o new.csv",
    "fleet": f"fleet fleet --identify {ROBOT} --folds 2 -o robots.csv",
    "demo": "demo -o demo",
    "demo full": "demo --full -o demo",
}
"""A command line by a short name; those that write name files that are not there before."""


@dataclass(frozen=True)
class End:
    """How a command ended that was interrupted."""

    moment: float
    """Seconds after its start."""
    took: float
    """Seconds from the interrupt to its end."""
    status: int
    said: str
    faults: tuple[str, ...]


def prepare(folder: Path) -> None:
    """The files that the commands read."""
    (folder / "task.toml").write_text(TASK)
    run(folder, f"simulate {ROBOT} --task task.toml --count 60 -o c.csv")
    run(folder, f"identify {ROBOT} c.csv -o cal.json")
    lines = (folder / "c.csv").read_text().splitlines()
    cells = [line.split(",") for line in lines]
    for row in cells[1:]:
        row[3] = f"{-float(row[3]):.6f}"  # the third joint turns the other way round
    (folder / "wrong.csv").write_text("\n".join(map(",".join, cells)) + "\n")
    rows = [f"{300 + 5 * k},{-40 + 4 * k},350,0,0.955,0,0.296" for k in range(20)]
    (folder / "fleet" / "one").mkdir(parents=True)
    (folder / "fleet" / "one" / "c.csv").write_text((folder / "c.csv").read_text())
    (folder / "joints.csv").write_text("\n".join(",".join(row[:6]) for row in _joints(cells)) + "\n")
    (folder / "table.csv").write_text("joint,alpha_deg,a_mm,d_mm,theta_offset_deg\nJ1,0,500,0,0\n")
    (folder / "path.csv").write_text("\n".join(["x_mm,y_mm,z_mm,qx,qy,qz,qw", *rows]) + "\n")


def _joints(cells: list[list[str]]) -> list[list[str]]:
    """Columns of the joints, of a campaign that begins with them or with names of rows."""
    first = next(k for k, name in enumerate(cells[0]) if name.upper().startswith("J1"))
    return [row[first : first + 6] for row in cells]


def run(folder: Path, line: str) -> None:
    """A command to its end."""
    subprocess.run([sys.executable, "-m", "taskcal", *line.split()], cwd=folder, check=True, capture_output=True)


def interrupt(folder: Path, line: str, moment: float, *, patience: float = 60.0) -> End | None:
    """Start a command, interrupt it and look at what it leaves; None where it had ended before.

    Args:
        folder: in which it runs.
        line: the command.
        moment: seconds after the start of the process.
        patience: seconds after which it is taken for hanging.
    """
    before = set(folder.rglob("*"))
    with tempfile.TemporaryFile("w+") as told:
        # a shell without job control starts what runs in the background deaf to interrupts, and its children inherit that
        process = subprocess.Popen(
            [sys.executable, "-m", "taskcal", *line.split()], cwd=folder, stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=told, start_new_session=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )  # fmt: skip
        with suppress(subprocess.TimeoutExpired):
            process.wait(moment)
            _remove(set(folder.rglob("*")) - before)
            return None
        start = time.monotonic()
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the workers are told too
        try:
            process.wait(patience)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        took = time.monotonic() - start
        told.seek(0)
        said = told.read()
    left = _left_of(process.pid)
    new = {path for path in set(folder.rglob("*")) - before if path.is_file()}
    end = End(moment, took, process.returncode, said, tuple(_faults(process.returncode, said, new, left)))
    _remove(set(folder.rglob("*")) - before)
    return end


def _faults(status: int, said: str, new: set[Path], left: Sequence[int]) -> list[str]:
    lines = [line for line in said.splitlines() if line]
    out = []
    if status == 0:  # the interrupt came when all was done
        return [f"and says {said!r}"] if "Traceback" in said else []
    if status != 130:
        out.append(f"status {status}")
    if "Traceback" in said or not lines or not lines[-1].startswith("interrupted: "):
        out.append(f"says {said[-1000:]!r}")
    elif sum(line.startswith("interrupted: ") for line in lines) > 1:
        out.append("says it twice")
    elif "nothing was written" in lines[-1] and new:
        out.append(f"leaves {sorted(path.name for path in new)} and says {lines[-1]!r}")
    if parts := [path.name for path in new if path.name.endswith(".part")]:
        out.append(f"leaves {parts}")
    if left:
        out.append(f"leaves {len(left)} processes")
    return out


def _left_of(group: int, seconds: float = 2.0) -> list[int]:
    """Processes of a group that are still there, and do not go."""
    until = time.monotonic() + seconds
    left = _members(group)
    while left and time.monotonic() < until:
        time.sleep(0.1)
        left = _members(group)
    for one in left:
        with suppress(OSError):
            os.kill(one, signal.SIGKILL)
    return left


def _members(group: int) -> list[int]:
    out: list[int] = []
    for place in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError, ValueError):
            state, _, of = place.read_text().rpartition(")")[2].split()[:3]
            if int(of) == group and state != "Z":
                out.append(int(place.parent.name))
    return out


def _remove(paths: set[Path]) -> None:
    for path in sorted(paths, reverse=True):
        with suppress(OSError):
            path.rmdir() if path.is_dir() else path.unlink()


def duration(folder: Path, line: str, limit: float) -> float:
    """Seconds that a command takes, or the limit."""
    start = time.monotonic()
    interrupt(folder, line, limit)
    return time.monotonic() - start


def main() -> None:
    """Interrupt every command some times."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("commands", nargs="*", metavar="COMMAND")
    parser.add_argument("--times", type=int, default=5)
    parser.add_argument("--limit", type=float, default=20.0, help="seconds of a command that are tried")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    rng = random.Random(chosen.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["TASKCAL_STATE_DIR"] = tempfile.mkdtemp(prefix="taskcal-state-")
        prepare(folder)
        for command in chosen.commands or COMMANDS:
            whole = duration(folder, COMMANDS[command], chosen.limit)
            worst, wrong = 0.0, 0
            for _ in range(chosen.times):
                end = interrupt(folder, COMMANDS[command], rng.uniform(0.1, whole))
                if end is None:
                    continue
                worst = max(worst, end.took)
                wrong += bool(end.faults)
                for fault in end.faults:
                    print(f"    {command} at {end.moment:.2f} s: {fault}", flush=True)
            print(f"{command}: {whole:.1f} s whole, at most {worst:.2f} s to the end, {wrong} wrong", flush=True)


if __name__ == "__main__":
    main()
