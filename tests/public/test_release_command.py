"""make release: both libraries, the same bytes at each build, with what is in them and from what they were made."""

import hashlib
import json
import os
import re
import shutil
import tomllib
import zipfile
from pathlib import Path

import pytest

from release import LIBRARIES, Refused, built, release, see_ready, state_version
from tests.built_wheel import ROOT, run

pytestmark = pytest.mark.skipif(
    shutil.which("git") is None and not os.environ.get("CI"), reason="a release is a tag of git"
)

DATE = "2030-01-02"


def git(folder: Path, *arguments: str) -> str:
    return run(["git", *arguments], folder)


def committed(folder: Path) -> Path:
    """A repository on main with all that lies in a folder."""
    git(folder, "init", "--quiet", "--initial-branch", "main")
    for key, value in {"user.name": "A", "user.email": "a@example.org", "commit.gpgsign": "false"}.items():
        git(folder, "config", key, value)
    git(folder, "add", ".")
    git(folder, "commit", "--quiet", "--message", "a change")
    return folder


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A repository of the files that state a version."""
    for name in ("CHANGELOG.md", "CITATION.cff", "pyproject.toml", "src/robot_programs/pyproject.toml"):
        (tmp_path / "small" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / "small" / name)
    return committed(tmp_path / "small")


def test_version_and_date_come_into_all_files_that_state_them(small: Path) -> None:
    news = (small / "CHANGELOG.md").read_text(encoding="utf-8").partition("## [Unreleased]\n")[2]
    for version in ("1.2.3", "1.2.4"):
        (small / "CHANGELOG.md").write_text(f"# Changelog\n\n## [Unreleased]\n{news}", encoding="utf-8")
        state_version(small, version, DATE)
        text = (small / "CHANGELOG.md").read_text(encoding="utf-8")
        assert text == f"# Changelog\n\n## [Unreleased]\n\n## [{version}] - {DATE}\n{news}"
        cited = (small / "CITATION.cff").read_text(encoding="utf-8")
        assert re.findall(r"^(?:version|date-released): (.*)$", cited, re.MULTILINE) == [version, DATE]
        for name in ("pyproject.toml", "src/robot_programs/pyproject.toml"):
            stated = tomllib.loads((small / name).read_text(encoding="utf-8"))
            assert stated["tool"]["hatch"]["version"]["fallback-version"] == f"{version}.dev0"
    with pytest.raises(Refused, match="nothing is listed"):  # what was unreleased is released now
        state_version(small, "1.2.5", DATE)


def test_release_is_refused_where_it_would_not_be_what_it_says(small: Path) -> None:
    out = small / "dist" / "1.2.3"
    see_ready(small, "1.2.3", out)
    for version in ("1.2", "v1.2.3", "1.2.3rc1"):
        with pytest.raises(Refused, match=r"such as 1\.2\.3"):
            see_ready(small, version, out)
    git(small, "tag", "v1.2.3")
    for version in ("1.2.3", "1.2.2", "0.9.9"):
        with pytest.raises(Refused, match=r"does not come after 1\.2\.3"):
            see_ready(small, version, out)
    see_ready(small, "1.2.10", out)
    (small / "new").touch()
    with pytest.raises(Refused, match="new"):
        see_ready(small, "1.2.10", out)
    (small / "new").unlink()
    git(small, "switch", "--quiet", "--create", "other")
    with pytest.raises(Refused, match="other"):
        see_ready(small, "1.2.10", out)


def test_archives_that_differ_when_built_again_are_refused(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("release.built_once", lambda clone, place: {"same": b"1", "a.whl": place.name.encode()})
    with pytest.raises(Refused, match=r"built twice: a\.whl$"):
        built(small, small)


@pytest.mark.long
def test_release_makes_both_libraries_and_states_their_origin(tmp_path: Path) -> None:
    """Dry, it leaves no trace in the repository; in earnest a commit and a tag, and the same files but for the commit's time."""
    files = git(ROOT, "ls-files", "--cached", "--others", "--exclude-standard").splitlines()
    for name in files:
        if (ROOT / name).is_file():
            (tmp_path / "project" / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tmp_path / "project" / name)
    root = committed(tmp_path / "project")
    before = git(root, "rev-parse", "HEAD")
    out = release(root, "1.2.3", dry=True, date=DATE)
    assert (git(root, "rev-parse", "HEAD"), git(root, "tag")) == (before, "")
    shutil.rmtree(out)
    out = release(root, "1.2.3", dry=False, date=DATE)
    assert git(root, "describe", "--exact-match") == "v1.2.3"
    assert git(root, "status", "--porcelain") == ""
    with pytest.raises(Refused):
        release(root, "1.2.3", dry=False, date=DATE)

    made = {path.name: path.read_bytes() for path in out.iterdir()}
    sums = dict(line.split("  ")[::-1] for line in made.pop("SHA256SUMS").decode().splitlines())
    assert sums == {name: hashlib.sha256(content).hexdigest() for name, content in made.items()}
    origin = json.loads(made["taskcal-1.2.3.provenance.json"])
    stated = {one["name"]: one["digest"]["sha256"] for one in origin["subject"]}
    assert stated == {name: digest for name, digest in sums.items() if "provenance" not in name}
    source = origin["predicate"]["buildDefinition"]["resolvedDependencies"][0]
    assert source["digest"]["gitCommit"] == git(root, "rev-parse", "v1.2.3^{commit}")
    for library in LIBRARIES:
        assert {f"{library}-1.2.3-py3-none-any.whl", f"{library}-1.2.3.tar.gz"} <= made.keys()
        bill = json.loads(made[f"{library}-1.2.3.cdx.json"])
        names = [one["name"] for one in bill["components"]]
        assert {"numpy", "jaxtyping"} <= set(names)
        assert len(names) == len(set(names))
        assert {ref for one in bill["dependencies"] for ref in one["dependsOn"]} == set(names)
    with zipfile.ZipFile(out / "robot_programs-1.2.3-py3-none-any.whl") as wheel:
        alone = {name: wheel.read(name) for name in wheel.namelist() if name.startswith("robot_programs/")}
    with zipfile.ZipFile(out / "taskcal-1.2.3-py3-none-any.whl") as wheel:
        inside = {name: wheel.read(name) for name in wheel.namelist() if name.startswith("robot_programs/")}
    assert alone == inside
    assert "robot_programs/py.typed" in alone
