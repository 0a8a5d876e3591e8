"""Every peer on every case: one process each, ended when its time is over."""

import json
import os
import platform
import resource
import signal
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers.cases import Case, main_cases, random_chain, ur10
from benchmarks.peers.environments import ADAPTERS, PEERS, Environment, Peer, make_environment, variables
from benchmarks.peers.scaling import measure_scaling

Result = dict[str, Any]
"""What goes into the file of results."""
PARTS = ("cases", "poses", "parameters", "robots", "scaling")
SOURCE = Path(__file__).parents[2] / "src"
POSES = tuple(10**k for k in range(2, 8))
JOINTS = (2, 4, 9, 16, 33, 50)
SCALED_JOINTS = (1, 2, 4, 9, 16, 33, 66)
ROBOTS = (1, 10, 100, 1000, 10_000)
CHAIN_ROWS = 400
STUDY_LIMIT = 600.0
"""Seconds of processor time that a study of robots may take."""
ENDED = (-signal.SIGXCPU, -signal.SIGKILL)
"""Exit statuses of a run that was ended for its time."""
SAID = 300
"""Characters of a peer's last words that are kept."""


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Which peers run, where, and for how long each."""

    environments: Mapping[str, Environment]
    limit: float
    """Seconds of processor time that one calibration should take; thrice as many end a run."""
    say: Callable[[str], None] = print

    def run(self, peer: Peer, folder: Path, start: str) -> Result:
        """What the adapter says of a case, or why it says nothing."""
        environment = self.environments[peer.name]
        if environment.refused:
            return {"failed": environment.refused}
        command = [environment.python, ADAPTERS / peer.adapter, folder, "--start", start, "--seconds", self.limit / 10]
        return self._json(command, variables(peer, SOURCE), round(3 * self.limit))

    def robots(self, count: int) -> Result:
        """A study of as many robots."""
        taskcal = PEERS[0]
        command = [self.environments[taskcal.name].python, ADAPTERS / "robots.py", count]
        return self._json(command, variables(taskcal, SOURCE), round(STUDY_LIMIT))

    def _json(self, command: Iterable[object], variables: dict[str, str], seconds: int) -> Result:
        allowed = partial(resource.setrlimit, resource.RLIMIT_CPU, (seconds, seconds))
        words = [str(word) for word in command]
        done = subprocess.run(words, env=variables, capture_output=True, text=True, preexec_fn=allowed)
        if done.returncode in ENDED:
            return {"failed": f"not done after {seconds} s of processor time"}
        if done.returncode:
            said = [line for line in done.stderr.splitlines() if line.strip()] or [f"ended with {done.returncode}"]
            return {"failed": said[-1].strip()[:SAID]}
        return json.loads(done.stdout.splitlines()[-1])


def measure(names: Iterable[str], parts: Iterable[str], data: Path | None, environments: Path, limit: float) -> Result:
    """Figures, as they go into the file of results.

    Args:
        names: the peers.
        parts: what is measured, of `PARTS`.
        data: folder of the measured robots, if there is one.
        environments: folder of the peers' environments.
        limit: seconds of processor time for one calibration.
    """
    peers = [peer for peer in PEERS if peer.name in set(names)]
    made = {peer.name: make_environment(peer, environments) for peer in peers}
    bench = Bench(environments=made, limit=limit)
    result: Result = {
        "machine": machine(),
        "limit_s": limit,
        "peers": {peer.name: described(peer, made[peer.name]) for peer in peers},
    }
    with tempfile.TemporaryDirectory() as folder:
        room = Path(folder)
        measured: dict[str, Callable[[], Any]] = {
            "cases": lambda: robots_of_all(bench, peers, main_cases(data), room),
            "poses": lambda: growing(bench, peers, POSES, ur10, room),
            "parameters": lambda: growing(bench, peers, JOINTS, lambda joints: random_chain(joints, CHAIN_ROWS), room),
            "robots": lambda: growing_robots(bench, ROBOTS),
            "scaling": lambda: measure_scaling(POSES, SCALED_JOINTS, bench.say),
        }
        return result | {part: measured[part]() for part in PARTS if part in set(parts)}


def described(peer: Peer, environment: Environment) -> Result:
    """A peer's versions."""
    packages = {name: environment.packages.get(name) for name in (peer.package, "numpy", "scipy")}
    return {"packages": packages, "python": platform.python_version(), "refused": environment.refused}


def machine() -> Result:
    """The processor and the day, no more."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines() if Path("/proc/cpuinfo").exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return {"processor": names[0] if names else platform.processor(), "cores": os.cpu_count(), "day": f"{date.today()}"}


def robots_of_all(bench: Bench, peers: list[Peer], cases: Mapping[str, Case | str], room: Path) -> Result:
    """Every peer on the three robots, from each of its starts."""
    results: Result = {}
    for name, case in cases.items():
        if isinstance(case, str):
            results[name] = {"missing": case}
            continue
        case.write(room / name)
        rows: Result = {}
        for peer in peers:
            rows[peer.name] = {start: bench.run(peer, room / name, start) for start in peer.starts}
            bench.say(f"{case.title}, {peer.name}: {rows[peer.name]}")
        results[name] = {"title": case.title, "results": rows}
    return results


def growing(bench: Bench, peers: list[Peer], sizes: tuple[int, ...], make: Callable[[int], Case], room: Path) -> Result:
    """Seconds of each peer against a size, from its easiest start, up to the first size that is too much for it."""
    results: Result = {peer.name: [] for peer in peers}
    left = list(peers)
    for size in sizes:
        if not left:
            break
        case = make(size)
        folder = room / f"{case.name}-{size}"
        case.write(folder)
        parameters = len(case.model)
        for peer in tuple(left):
            found = bench.run(peer, folder, peer.starts[-1])
            found |= {"size": size, "model_parameters": parameters}
            results[peer.name].append(found)
            bench.say(f"{case.title}, {size}, {peer.name}: {found}")
            if "failed" in found or found["first_s"] > bench.limit:
                left.remove(peer)
        for file in folder.iterdir():
            file.unlink()
    return results


def growing_robots(bench: Bench, sizes: tuple[int, ...]) -> list[Result]:
    """Seconds of Taskcal's study against the number of robots, up to the first number that is too large."""
    results: list[Result] = []
    for size in sizes:
        found = bench.robots(size) | {"size": size}
        results.append(found)
        bench.say(f"{size} robots: {found}")
        if "failed" in found or found["first_s"] > STUDY_LIMIT / 10:
            break
    return results


def slope(rows: list[Result], key: str = "warm_s", size: str = "size") -> float | None:
    """Exponent of cost over the upper half of the sizes, by least squares of the logarithms."""
    done = [(row[size], row[key]) for row in rows if "failed" not in row]
    upper = done[max(0, min(len(done) // 2, len(done) - 2)) :]
    if len(upper) < 2:
        return None
    x, y = np.log(np.array(upper, dtype=float)).T
    return float(np.polyfit(x, y, 1)[0])
