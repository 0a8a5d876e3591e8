"""The wheel as it is released: built from a source distribution, without a network."""

import subprocess
import sys
import tarfile
from pathlib import Path

ROOT = Path(__file__).parents[1]


def run(command: list[str], folder: Path = ROOT, **environment: str) -> str:
    """What a program writes.

    Args:
        command: program and arguments.
        folder: where it runs.
        environment: all of its environment, where any is given.
    """
    ended = subprocess.run(
        command,
        cwd=folder,
        env=environment or None,
        capture_output=True,
        text=True,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout.strip()


def build(folder: Path, project: Path = ROOT, **environment: str) -> tuple[Path, Path]:
    """Build a project into an empty folder; gives the source distribution, and the wheel that was built from it alone."""
    hatch = [sys.executable, "-m", "hatchling", "build", "--directory", str(folder)]
    run([*hatch, "--target", "sdist"], project, **environment)
    (source,) = folder.glob("*.tar.gz")
    with tarfile.open(source) as packed:
        packed.extractall(folder / "unpacked", filter="data")
    run([*hatch, "--target", "wheel"], folder / "unpacked" / source.name.removesuffix(".tar.gz"), **environment)
    (wheel,) = folder.glob("*.whl")
    return source, wheel
