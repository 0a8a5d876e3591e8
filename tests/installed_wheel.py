"""Run tests against the wheel, not the sources: `python -m tests.installed_wheel [arguments of pytest]`.

The wheel is built from a source distribution and installed into an environment of its own. What it depends on is taken from this
environment, so that no network is needed; the installation of the sources, which lies there too, is not seen from the other.
"""

import json
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.built_wheel import ROOT, build, run


def install(folder: Path, wheel: Path) -> Path:
    """An environment with the wheel in it; gives its folder of programs."""
    run([sys.executable, "-m", "venv", "--without-pip", str(folder)])
    programs = folder / ("Scripts" if sys.platform == "win32" else "bin")
    python = str(programs / "python")
    run([sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index", str(wheel)])
    own = Path(run([python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]))
    # folders that a .pth file names are not searched for further ones, such as that of an editable installation
    shared = [place for place in sys.path if "site-packages" in place]
    (own / "what-it-depends-on.pth").write_text("\n".join(shared) + "\n", encoding="utf-8")
    return programs


def check(programs: Path, wheel: Path) -> None:
    """See that the environment runs the wheel, its version is said alike, and the README's first commands need no other program."""
    place, version = run(
        [str(programs / "python"), "-c", "import taskcal; print(taskcal.__file__, taskcal.__version__, sep='\\n')"]
    ).split("\n")
    assert Path(place).is_relative_to(programs.parent), place
    assert wheel.name.split("-")[1] == version
    assert run([str(programs / "taskcal"), "--version"]) == f"taskcal {version}"
    no_others = {**os.environ, "PATH": str(programs)}  # no git, no make, no compiler
    installation, *commands = first_commands()
    assert installation.startswith("pip install taskcal-"), installation
    empty = programs.parent / "empty"
    empty.mkdir()
    for command in commands:
        program, *arguments = command.split()
        said = run([str(programs / program), *arguments, "--json"], empty, **no_others)
    assert (empty / json.loads(said)["files"]["page"]).is_file()


def first_commands() -> list[str]:
    """The first commands of the README, which begin with the installation of the wheel."""
    found = re.search(r"(?:^ {4}\S.*\n)+", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert found is not None
    return [line.strip() for line in found[0].splitlines()]


def main(arguments: Sequence[str]) -> int:
    """Build, install and test; returns pytest's exit status."""
    with TemporaryDirectory(prefix="taskcal-wheel-") as made:
        _, wheel = build(Path(made))
        programs = install(Path(made) / "environment", wheel)
        check(programs, wheel)
        print(f"tests of {wheel.name}", flush=True)
        return subprocess.run([str(programs / "python"), "-m", "pytest", *arguments], cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
