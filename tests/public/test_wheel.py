"""What is built to be installed elsewhere holds all that the package reads beside its modules."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import taskcal

ROOT = Path(__file__).parents[2]
READ_BESIDE_MODULES = ("**/*.pyi", "py.typed", "robot/catalogue/*.toml", "demo/*.toml", "**/*.j2")

USE = """
import taskcal
print(taskcal.__file__)
for name in taskcal.__all__:
    getattr(taskcal, name)
taskcal.ErrorModel(taskcal.load_robot("ur5"))
"""


def run(*arguments: str, folder: Path) -> str:
    """A Python process that finds packages in a folder before those of this environment."""
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    ended = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.mark.slow
def test_the_wheel_holds_everything_and_its_public_names_load(tmp_path: Path) -> None:
    run("-m", "hatchling", "build", "--target", "wheel", "--directory", str(tmp_path / "dist"), folder=tmp_path)
    (wheel,) = (tmp_path / "dist").iterdir()
    installed = tmp_path / "installed"
    run(
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-deps",
        "--no-index",
        "--target",
        str(installed),
        str(wheel),
        folder=tmp_path,
    )
    source = Path(taskcal.__file__).parent
    for pattern in READ_BESIDE_MODULES:
        files = {path.relative_to(source) for path in source.glob(pattern)}
        assert files, pattern
        assert files <= {path.relative_to(installed / "taskcal") for path in installed.glob(f"taskcal/{pattern}")}
    assert run("-c", USE, folder=installed).strip() == str(installed / "taskcal" / "__init__.py")
