"""The command line in this process, and the files that its commands read."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskcal.cli import main
from taskcal.geometry import se3
from taskcal.task.task import load_task

IRB6660 = "abb-irb6660-205-1.9"

TASK = """
name = "pocket milling"
[workspace]
frame = "base"
shape = "box"
center_mm = [1711.0, 30.0, 1489.0]
size_mm = [500.0, 700.0, 500.0]
[[workspace.orientation]]
quaternion = [0.0, 0.955, 0.0, 0.296]
cone_deg = 30.0
[accuracy]
position_mm = 0.1
"""


@dataclass(frozen=True)
class Ended:
    status: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


Run = Callable[..., Ended]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run a command in this process."""

    def call(*arguments: object) -> Ended:
        capsys.readouterr()
        status = main([str(a) for a in arguments])
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        return Ended(status, captured.out, captured.err)

    return call


def _write_list(folder: Path) -> None:
    """The same task as a list of forty poses, which is reached sooner."""
    workspace = load_task(folder / "task.toml").workspace
    assert workspace is not None
    T = workspace.sample(40)
    rows = np.c_[T[:, :3, 3] * 1e3, se3.to_quaternion(T[:, :3, :3])]
    lines = ["x_mm,y_mm,z_mm,qx,qy,qz,qw", *(",".join(f"{value:.9f}" for value in row) for row in rows)]
    (folder / "list.csv").write_text("\n".join(lines) + "\n")
    (folder / "list.toml").write_text('name = "forty poses"\nposes = "list.csv"\n[accuracy]\nposition_mm = 0.1\n')


@pytest.fixture(scope="session")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a task, campaigns of one and three reflectors and of poses, a calibration of the first, and another campaign
    of the robot of the first."""
    folder = tmp_path_factory.mktemp("cell")
    (folder / "task.toml").write_text(TASK)
    _write_list(folder)
    task = ["--robot", IRB6660, "--task", str(folder / "task.toml"), "--json"]
    truth = ["--truth", str(folder / "truth.json")]
    assert main(["simulate", *task, "--count", "60", "-o", str(folder / "one.csv"), *truth]) == 0
    same = ["--truth-from", str(folder / "truth.json"), "--seed", "1"]
    assert main(["simulate", *task, "--count", "40", "-o", str(folder / "other.csv"), *same]) == 0
    assert main(["simulate", *task, "--count", "30", "-o", str(folder / "three.csv"), "--targets", "3"]) == 0
    assert main(["simulate", *task, "--count", "30", "-o", str(folder / "poses.csv"), "--pose"]) == 0
    assert (
        main(["identify", "--robot", IRB6660, str(folder / "one.csv"), "-o", str(folder / "cal.json"), "--json"]) == 0
    )
    return folder
