"""The version comes from the tags, and is there without any."""

import os
import shutil
import sys
from pathlib import Path

import pytest

from tests.built_wheel import ROOT, run

GIT = shutil.which("git")

NEEDS_GIT = pytest.mark.skipif(
    GIT is None and not os.environ.get("CI"),
    reason="tags are made and read by git; the version without it is held above",
)
"""A machine of a newcomer may have none; where all is checked it has to be there."""


def version_of(folder: Path, **environment: str) -> str:
    return run([sys.executable, "-m", "hatchling", "version"], folder, **{**os.environ, **environment})


def commit(folder: Path, *tags: str) -> None:
    who = ["-c", "user.name=A", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false"]
    run([str(GIT), *who, "commit", "--quiet", "--allow-empty", "--message", "a change"], folder)
    for tag in tags:
        run([str(GIT), "tag", tag], folder)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """The project's own settings, in a folder of no repository."""
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def test_version_without_repository_precedes_next_release(project: Path) -> None:
    """Without a repository, the version is a development version of the next release."""
    assert version_of(project) == "0.1.0.dev0"


@NEEDS_GIT
def test_version_is_tag_and_later_commits_precede_next(project: Path) -> None:
    """A tag gives the version, and later commits are development versions of the next one."""
    run([str(GIT), "init", "--quiet"], project)
    run([str(GIT), "add", "."], project)
    commit(project)
    assert version_of(project) == "0.1.0.dev1"
    assert version_of(project, PATH=str(project)) == "0.1.0.dev0"  # a repository, and no git
    commit(project, "v1.2.3")
    assert version_of(project) == "1.2.3"
    commit(
        project, "nightly-2026", "build/7"
    )  # which are not versions, and would stop the installation if taken for them
    assert version_of(project) == "1.2.4.dev1"


@NEEDS_GIT
def test_version_ignores_enclosing_repository(project: Path) -> None:
    """A folder inside another repository does not take the version of that repository."""
    run([str(GIT), "init", "--quiet"], project)
    commit(project, "v1.2.3")
    inner = project / "inner"
    inner.mkdir()
    shutil.copy(ROOT / "pyproject.toml", inner)
    assert version_of(inner) == "0.1.0.dev0"
