"""What a release states of itself is stated alike wherever it is stated."""

import platform
import re
import shutil
import subprocess
import sys
import tomllib
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

import taskcal
from docs.dependency_table import RUNTIME_EXTRAS, closure

ROOT = Path(__file__).parents[2]


STATED = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CITED = dict(
    re.findall(r"^(version|license): (.+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
)


def test_citation_matches_licence_and_next_version():
    """The citation names the licence of the package and the next release."""
    assert CITED["license"] == STATED["project"]["license"]
    alone = tomllib.loads((ROOT / "src" / "robot_programs" / "pyproject.toml").read_text(encoding="utf-8"))
    for one in (STATED, alone):
        assert one["tool"]["hatch"]["version"]["fallback-version"] == f"{CITED['version']}.dev0"
    for key in ("license", "requires-python"):
        assert alone["project"][key] == STATED["project"][key]
    assert set(alone["project"]["dependencies"]) <= set(STATED["project"]["dependencies"])
    assert taskcal.__version__ == metadata.version("taskcal")


def test_tagged_release_is_cited_and_in_changelog():
    """A tagged release is the one that is cited and listed in the changelog."""
    git = shutil.which("git")
    if git is None or not (ROOT / ".git").exists():
        pytest.skip("no repository here")
    tag = subprocess.run(
        [git, "describe", "--tags", "--exact-match"], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.strip()
    if not tag:
        pytest.skip("not a release")
    assert tag == f"v{CITED['version']}"
    assert f"## [{CITED['version']}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def requirements(*groups: str) -> dict[str, str]:
    """Lower bounds by name, of what is needed to run with some extras."""
    project = STATED["project"]
    named = [*project["dependencies"], *(one for group in groups for one in project["optional-dependencies"][group])]
    return dict(re.sub(r"\[.*?\]", "", one).split(">=") for one in named)


def test_oldest_tested_versions_are_the_promised_minimum():
    """The oldest versions under test are the stated minimum versions."""
    lines = (ROOT / "constraints-oldest.txt").read_text(encoding="utf-8").splitlines()
    tried = dict(line.split("==") for line in lines if not line.startswith("#"))
    promised = requirements(*RUNTIME_EXTRAS)
    assert tried.keys() == promised.keys()
    assert {name: Version(bound) for name, bound in promised.items()} == {n: Version(v) for n, v in tried.items()}


def test_every_dependency_is_tried_in_a_stated_version():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    stated = dict(line.split("==") for line in lines)
    assert len(stated) == len(lines)
    named = [one for group in STATED["project"]["optional-dependencies"].values() for one in group]
    asked = [Requirement(one) for one in (*STATED["project"]["dependencies"], *named)]
    known = {canonicalize_name(name): version for name, version in stated.items()}
    for one in asked:
        if one.name != "taskcal":
            assert known[canonicalize_name(one.name)] in one.specifier, one


@pytest.mark.skipif(
    (sys.version_info[:2], platform.system()) != ((3, 11), "Linux"),
    reason="which packages others need depends on Python's release and the system; the list is made on Python 3.11, Linux",
)
def test_constraints_pin_all_build_and_test_packages():
    """So that an installation takes only versions that were tried, and needs no other; of pip freeze, setuptools is left out."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    stated = {canonicalize_name(line.split("==")[0]) for line in lines}
    tried = "test,browser" if find_spec("playwright") else "test"  # what an environment has, that is looked at
    needed = closure([*STATED["build-system"]["requires"], f"taskcal[{tried}]"])
    assert needed - stated == {"taskcal"}


def test_no_source_evaluates_or_unpickles_what_it_reads():
    """The linter refuses these names; this holds the list of the places where it was told to be quiet."""
    quiet = {
        (str(path.relative_to(ROOT)), code)
        for path in (*(ROOT / "src").rglob("*.py"), *(ROOT / "examples").rglob("*.py"))
        for code in re.findall(r"# noqa: (S\d+)", path.read_text(encoding="utf-8"))
    }
    assert quiet == {("src/taskcal/kernels/kernel_cache.py", "S301"), ("src/taskcal/report/page.py", "S704")}
