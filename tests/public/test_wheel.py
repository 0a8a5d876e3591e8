"""What is built to be installed elsewhere holds all that the package reads beside its modules."""

import os
import sys
from email import message_from_string
from pathlib import Path

import pytest

from tests.built_wheel import ROOT, build, run

READ_BESIDE_MODULES = (
    "src/*/**/*.pyi",
    "src/*/py.typed",
    "src/taskcal/robot/catalogue/*.toml",
    "examples/taskcal_demo/*.toml",
    "src/*/**/*.j2",
    "src/*/**/*.js",
    "src/*/**/*.css",
)

USE = """
print(taskcal.__file__)
for name in taskcal.__all__:
    getattr(taskcal, name)
taskcal.ErrorModel(taskcal.load_robot("ur5"))
"""


@pytest.mark.long
def test_wheel_from_sdist_is_complete_and_importable(tmp_path: Path) -> None:
    """The wheel built from the source distribution is complete, and its public names load."""
    source, wheel = build(tmp_path)
    installed = tmp_path / "installed"
    asked = ["--quiet", "--no-deps", "--no-index", "--target", str(installed), str(wheel)]
    run([sys.executable, "-m", "pip", "install", *asked])
    for pattern in READ_BESIDE_MODULES:
        files = sorted(ROOT.glob(pattern))
        assert files, pattern
        assert [path for path in files if not installed.joinpath(*path.relative_to(ROOT).parts[1:]).is_file()] == []
    elsewhere = {**os.environ, "PYTHONPATH": str(installed)}
    assert run([sys.executable, "-c", USE], tmp_path, **elsewhere) == str(installed / "taskcal" / "__init__.py")
    (stated,) = installed.glob("taskcal-*.dist-info/METADATA")
    said = message_from_string(stated.read_text(encoding="utf-8"))
    assert source.name == f"taskcal-{said['Version']}.tar.gz"
    assert said["License-Expression"] == "Apache-2.0"
    assert (stated.parent / "licenses" / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()
