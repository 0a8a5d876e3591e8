"""A virtual environment for each peer, made on first use: what one of them requires would break another."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ADAPTERS = Path(__file__).with_name("adapters")


@dataclass(frozen=True, kw_only=True)
class Peer:
    """A way to calibrate."""

    name: str
    adapter: str
    """File in ``adapters``."""
    requires: tuple[str, ...] = ()
    """Packages of its environment; none for Taskcal, which runs in this one."""
    environment: str = ""
    """Name of the environment."""
    starts: tuple[str, ...] = ("raw", "given")
    """``raw``, from rows and nominal robot alone; ``given``, with the frames registered beforehand."""
    settings: tuple[tuple[str, str], ...] = ()
    """Variables of its environment."""

    @property
    def package(self) -> str:
        """What is named with its version."""
        return self.requires[0] if self.requires else "taskcal"


FIGAROH = ("figaroh", "pyyaml")
PYBOTICS = ("pybotics", "scipy", "numpy<2")
PEERS = (
    Peer(name="Taskcal", adapter="taskcal_fit.py", starts=("raw",)),
    Peer(name="SciPy, differences", adapter="scipy_fit.py", requires=("scipy", "numpy"), environment="scipy"),
    Peer(name="Pinocchio + SciPy", adapter="pinocchio_fit.py", requires=("pin", "scipy"), environment="pinocchio"),
    Peer(
        name="FIGAROH",
        adapter="figaroh_fit.py",
        requires=FIGAROH,
        environment="figaroh",
        starts=("raw",),
    ),
    Peer(
        name="FIGAROH, map",
        adapter="figaroh_fit.py",
        requires=FIGAROH,
        environment="figaroh",
        starts=("raw",),
        settings=(("FIGAROH_METHOD", "map"),),
    ),
    Peer(name="robotkinecal", adapter="robotkinecal_fit.py", requires=("robotkinecal",), environment="robotkinecal"),
    Peer(
        name="pybotics",
        adapter="pybotics_fit.py",
        requires=PYBOTICS,
        environment="pybotics",
        starts=("given",),  # what raw rows do is seen quicker from its components
    ),
    Peer(name="pybotics, components", adapter="pybotics_points_fit.py", requires=PYBOTICS, environment="pybotics"),
)


@dataclass(frozen=True, kw_only=True)
class Environment:
    """Where a peer runs."""

    python: Path
    packages: dict[str, str]
    """Versions of what is installed."""
    refused: str = ""
    """Why it could not be installed; empty if it was."""


def make_environment(peer: Peer, folder: Path) -> Environment:
    """The environment of a peer below a folder, made and filled if it is not there; Taskcal's is this one."""
    if not peer.environment:
        return Environment(python=Path(sys.executable), packages=versions(Path(sys.executable)))
    home = folder / peer.environment
    python = home / "bin" / "python"
    if not (home / "complete").exists():
        subprocess.run([sys.executable, "-m", "venv", "--clear", home], check=True)
        command = [
            python,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "--no-input",
            *peer.requires,
        ]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            errors = [line for line in done.stderr.splitlines() if line.startswith("ERROR")]
            return Environment(python=python, packages={}, refused=(errors or ["pip failed"])[-1])
        (home / "complete").touch()
    return Environment(python=python, packages=versions(python))


def versions(python: Path) -> dict[str, str]:
    """What is installed, by name."""
    text = (
        "import importlib.metadata as m, json; "
        "print(json.dumps({d.metadata['Name'].lower(): d.version for d in m.distributions() if d.metadata['Name']}))"
    )
    return json.loads(subprocess.run([python, "-c", text], check=True, capture_output=True, text=True).stdout)


def variables(peer: Peer, source: Path) -> dict[str, str]:
    """Environment of a run: one thread of BLAS, nothing of this project on the path of a peer."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    path = {} if peer.environment else {"PYTHONPATH": str(source)}
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return {**kept, **threads, **path, **dict(peer.settings)}
