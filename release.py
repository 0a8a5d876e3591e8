"""Make a release up to the upload: `make release VERSION=1.2.3`, and with `DRY=1` without a trace in the repository.

All is done in a clone: the changelog, `CITATION.cff` and fallback versions are brought to the version and committed, the commit is
tagged, and from the tag both libraries are built, twice, to the same bytes. Only what passed all checks comes back to the
repository, as a commit and a tag; what is to be uploaded lies in `dist/VERSION`, and the last lines say what is left to do.
"""

import argparse
import hashlib
import json
import os
import platform
import re
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib.metadata import metadata
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from uuid import NAMESPACE_URL, uuid5

from packaging.licenses import InvalidLicenseExpression, canonicalize_license_expression
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from docs.dependency_table import RUNTIME_EXTRAS, closure, licence
from tests.built_wheel import ROOT, build, run
from tests.installed_wheel import check, install

LIBRARIES = {"taskcal": ".", "robot_programs": "src/robot_programs"}
"""Folders of the projects, by the names of their archives."""

UNRELEASED = "## [Unreleased]\n"


class Refused(Exception):
    """The release cannot be made."""


def git(root: Path, *arguments: str) -> str:
    """What git prints.

    Raises:
        Refused: it fails.
    """
    try:
        return run(["git", *arguments], root)
    except (AssertionError, FileNotFoundError) as error:
        raise Refused(f"git {' '.join(arguments[:2])}: {error}") from error


def see_ready(root: Path, version: str, out: Path) -> None:
    """See that a repository is on main, without changes, and behind the version.

    Raises:
        Refused: it is not.
    """
    if not re.fullmatch(r"\d+\.\d+\.\d+", version):
        raise Refused(f"'{version}' is not a version; write three numbers, such as 1.2.3")
    if (branch := git(root, "rev-parse", "--abbrev-ref", "HEAD")) != "main":
        raise Refused(f"a release is made on main, and this is {branch}")
    if changed := git(root, "status", "--porcelain"):
        raise Refused(f"there are changes that are not committed:\n{changed}")
    tags = [tag for tag in git(root, "tag").split() if re.fullmatch(r"v\d+\.\d+\.\d+", tag)]
    newest = max((Version(tag) for tag in tags), default=None)
    if newest is not None and Version(version) <= newest:
        raise Refused(f"{version} does not come after {newest}, which is released")
    if out.exists():
        raise Refused(f"{out} exists; remove it")


def stated(text: str, name: str, pattern: str, new: str) -> str:
    """A text with the one place that a pattern finds replaced.

    Raises:
        Refused: there is none, or there are several.
    """
    text, count = re.subn(pattern, lambda _: new, text, flags=re.MULTILINE)
    if count != 1:
        raise Refused(f"{name}: {count} places look like {pattern!r}; one is needed")
    return text


def state_version(root: Path, version: str, date: str) -> None:
    """Bring the version into all files that state it.

    Raises:
        Refused: one lacks the place for it, or nothing is listed as unreleased.
    """
    changelog = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    news = changelog.partition(UNRELEASED)[2].partition("\n## [")[0]
    if not re.search(r"^- ", news, re.MULTILINE):
        raise Refused("CHANGELOG.md: nothing is listed under '## [Unreleased]'; list what a user will notice")
    dated = {
        "CHANGELOG.md": (r"^## \[Unreleased\]$", f"{UNRELEASED}\n## [{version}] - {date}"),
        "CITATION.cff": (r"^version: .*(\ndate-released: .*)?$", f"version: {version}\ndate-released: {date}"),
        "pyproject.toml": (r"^fallback-version = .*$", f'fallback-version = "{version}.dev0"'),
        "src/robot_programs/pyproject.toml": (r"^fallback-version = .*$", f'fallback-version = "{version}.dev0"'),
    }
    for name, (pattern, new) in dated.items():
        text = (root / name).read_text(encoding="utf-8")
        (root / name).write_text(stated(text, name, pattern, new), encoding="utf-8", newline="\n")


def tagged(root: Path, place: Path, version: str, date: str) -> Path:
    """A clone with the release committed and tagged."""
    git(root, "clone", "--quiet", str(root), str(place))
    state_version(place, version, date)
    for key in ("user.name", "user.email"):
        git(place, "config", key, git(root, "config", key))
    git(place, "commit", "--quiet", "--all", "--message", f"Release {version}")
    git(place, "tag", "--annotate", f"v{version}", "--message", f"Taskcal {version}")
    return place


def built_once(clone: Path, place: Path) -> dict[str, bytes]:
    """Archives of both libraries by their names, built in a clone of their own."""
    git(clone, "clone", "--quiet", str(clone), str(place / "source"))
    environment = {**os.environ, "SOURCE_DATE_EPOCH": git(clone, "log", "-1", "--format=%ct")}
    made = [
        file
        for name, folder in LIBRARIES.items()
        for file in build(place / name, place / "source" / folder, **environment)
    ]
    return {file.name: file.read_bytes() for file in made}


def built(clone: Path, place: Path) -> dict[str, bytes]:
    """Archives of both libraries, which come out the same when they are built again elsewhere.

    Raises:
        Refused: they do not.
    """
    first, second = (built_once(clone, place / name) for name in ("once", "again-in-another-place"))
    if different := [name for name in first if first[name] != second.get(name)]:
        raise Refused(f"not the same bytes when built twice: {', '.join(different)}")
    return first


def components(asked: Iterable[str], scope: str, versions: dict[str, str]) -> dict[str, Any]:
    """Entries of a bill of materials by name, for requirements and all that they need."""
    return {
        name: {
            "type": "library", "bom-ref": name, "name": name, "version": versions[name], "scope": scope,
            "purl": f"pkg:pypi/{name}@{versions[name]}", "licenses": [_licence(licence(name))],
        }
        for name in sorted(closure(asked))
    }  # fmt: skip


def _licence(said: str) -> dict[str, Any]:
    try:
        return {"expression": canonicalize_license_expression(said)}
    except InvalidLicenseExpression:
        return {"license": {"name": said}}


def bill_of_materials(source: Path, name: str, version: str, moment: str) -> dict[str, Any]:
    """What a library needs to run and with its extras, in the tried versions, as CycloneDX 1.6."""
    lines = (source / "constraints.txt").read_text(encoding="utf-8").splitlines()
    versions = {canonicalize_name(package): tried for package, tried in (line.split("==") for line in lines)}
    project = tomllib.loads((source / LIBRARIES[name] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project.get("optional-dependencies", {})
    optional = [one for extra in RUNTIME_EXTRAS for one in extras.get(extra, ())]
    found = components(optional, "optional", versions) | components(project["dependencies"], "required", versions)
    own = canonicalize_name(name)
    needs = {own: [*project["dependencies"], *optional]}
    needs |= {one: metadata(one).get_all("Requires-Dist") or [] for one in found}
    wanted = {one: [Requirement(text) for text in asked] for one, asked in needs.items()}
    of_them = defaultdict[str, set[str]](set)
    for one in (one for asked in wanted.values() for one in asked):
        of_them[canonicalize_name(one.name)] |= one.extras
    return {
        "bomFormat": "CycloneDX", "specVersion": "1.6", "version": 1,
        "serialNumber": uuid5(NAMESPACE_URL, f"urn:{own}:{version}:{moment}").urn,
        "metadata": {
            "timestamp": moment,
            "component": {
                "type": "library", "bom-ref": own, "name": own, "version": version,
                "purl": f"pkg:pypi/{own}@{version}", "licenses": [{"expression": project["license"]}],
            },
        },
        "components": list(found.values()),
        "dependencies": [
            {"ref": one, "dependsOn": sorted(_direct(asked, of_them[one]) & set(found))} for one, asked in wanted.items()
        ],
    }  # fmt: skip


def _direct(asked: Iterable[Requirement], extras: Iterable[str]) -> set[str]:
    """Names of what is required here by a package with some extras."""
    return {
        canonicalize_name(one.name)
        for one in asked
        if one.marker is None or any(one.marker.evaluate({"extra": extra}) for extra in ("", *extras))
    }


def provenance(clone: Path, version: str, digests: dict[str, str]) -> dict[str, Any]:
    """From which sources and by which programs files were made: a statement of in-toto, with SLSA's predicate."""
    commit, tree = git(clone, "rev-parse", "HEAD", "HEAD^{tree}").split()
    builders = sorted(closure(["hatchling", "hatch-vcs"]))
    return {
        "_type": "https://in-toto.io/Statement/v1",
        "subject": [{"name": name, "digest": {"sha256": digest}} for name, digest in digests.items()],
        "predicateType": "https://slsa.dev/provenance/v1",
        "predicate": {
            "buildDefinition": {
                "buildType": "urn:taskcal:make-release:v1",
                "externalParameters": {"version": version, "command": f"make release VERSION={version}"},
                "resolvedDependencies": [
                    {"name": "source", "digest": {"gitCommit": commit, "gitTree": tree}},
                    *({"name": name, "annotations": {"version": metadata(name)["Version"]}} for name in builders),
                ],
            },
            "runDetails": {
                "builder": {"id": "urn:taskcal:release.py", "version": {"python": platform.python_version()}}
            },
        },
    }


def see_them_work(wheels: dict[str, Path], place: Path) -> None:
    """Install each wheel apart and use it, without a network.

    Raises:
        Refused: one does not work.
    """
    try:
        check(install(place / "taskcal", wheels["taskcal"]), wheels["taskcal"])
        python = str(install(place / "robot_programs", wheels["robot_programs"]) / "python")
        used = run([python, "-c", "import robot_programs as r; r.read_program; print(r.__file__)"], place)
        assert Path(used).is_relative_to(place), used
    except AssertionError as error:
        raise Refused(f"the wheel does not work where it is installed: {error}") from error


def release(root: Path, version: str, *, dry: bool, date: str) -> Path:
    """Make a release of a repository; returns the folder of what is to be uploaded.

    Raises:
        Refused: a check fails; the repository is then as it was, and nothing is in the folder.
    """
    out = root / "dist" / version
    see_ready(root, version, out)
    with TemporaryDirectory(prefix="taskcal-release-") as name:
        place = Path(name)
        clone = tagged(root, place / "clone", version, date)
        files = built(clone, place)
        second = int(git(clone, "log", "-1", "--format=%ct"))
        moment = datetime.fromtimestamp(second, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        for library in LIBRARIES:
            bill = bill_of_materials(clone, library, version, moment)
            files[f"{library}-{version}.cdx.json"] = _json(bill)
        digests = {name: hashlib.sha256(content).hexdigest() for name, content in sorted(files.items())}
        files[f"taskcal-{version}.provenance.json"] = _json(provenance(clone, version, digests))
        sums = {name: hashlib.sha256(content).hexdigest() for name, content in sorted(files.items())}
        files["SHA256SUMS"] = "".join(f"{digest}  {name}\n" for name, digest in sums.items()).encode()
        ready = place / "ready"
        ready.mkdir()
        for name, content in files.items():
            (ready / name).write_bytes(content)
        wheels = {library: next(ready.glob(f"{library}-{version}-*.whl")) for library in LIBRARIES}
        see_them_work(wheels, place / "installed")
        if not dry:
            git(root, "fetch", "--quiet", str(clone), f"refs/tags/v{version}:refs/tags/v{version}")
            git(root, "merge", "--quiet", "--ff-only", f"v{version}")
        out.mkdir(parents=True)
        for name, content in files.items():
            (out / name).write_bytes(content)
    return out


def _json(content: dict[str, Any]) -> bytes:
    return f"{json.dumps(content, indent=2, ensure_ascii=False)}\n".encode()


def main() -> None:
    """Make the release that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m release", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("version", help="three numbers, such as 1.2.3")
    parser.add_argument("--dry", action="store_true", help="neither commit nor tag; the files are made all the same")
    asked = parser.parse_args()
    try:
        out = release(ROOT, asked.version, dry=asked.dry, date=datetime.now(UTC).date().isoformat())
    except Refused as refusal:
        sys.exit(f"no release: {refusal}")
    for file in sorted(out.iterdir()):
        print(f"{file.relative_to(ROOT)}  {file.stat().st_size} bytes")
    if asked.dry:
        print("dry: nothing was committed or tagged")
    else:
        print(f"left to do: git push origin main v{asked.version}, and upload what is in {out.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
