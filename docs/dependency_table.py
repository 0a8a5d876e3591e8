"""What Taskcal is built on, under which licences and how large, from the installed packages (make licences)."""

import re
import sys
import tomllib
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, distribution, metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "reference" / "dependencies.md"

RUNTIME_EXTRAS = ("dask", "images", "live", "mujoco", "pandas", "parquet", "studio", "urdf")
"""Extras that a user installs; the others are for those who work on Taskcal."""

TERMS = {
    "0BSD": "0BSD",
    "Apache": "Apache-2.0",
    "BSD": "BSD-3-Clause",
    "BSD 2-Clause": "BSD-2-Clause",
    "BSD 3-Clause": "BSD-3-Clause",
    "CC0": "CC0-1.0",
    "GNU General Public License": "GPL-3.0-or-later",
    "GPL": "GPL-3.0-or-later",
    "ISC": "ISC",
    "GNU Lesser General Public License v3": "LGPL-3.0-or-later",
    "LGPL": "LGPL-2.1-or-later",
    "MIT": "MIT",
    "MPL": "MPL-2.0",
    "PSF": "PSF-2.0",
    "Python Software Foundation": "PSF-2.0",
    "Redistribution and use in source and binary forms": "BSD-3-Clause",
    "Public Domain": "public domain",
    "Unlicense": "Unlicense",
    "Zlib": "Zlib",
    "zlib": "Zlib",
}
"""SPDX's name of a licence, by how metadata of older forms begin to name it; the longest that fits counts."""

FIRST_WORDS = 200
"""Characters of a licence's text that are looked at, where metadata hold the text in place of its name."""

INTRO = """# Dependencies and their licences

Made by `make licences` from the metadata of the installed packages; a test holds it to what is declared and installed. All
are permissive, or copyleft of single files or libraries (MPL, LGPL). What only tests, checks and documentation need is not
listed: it is not installed with Taskcal.

**Bold**: asked for by Taskcal; the others by these. Where a package names several licences for its parts, all stand here, `;`
between them. Of docutils the GPL covers an Emacs mode alone (its `COPYING`); nothing of Taskcal imports docutils.
Sizes are those of the installed files, MiB, on Python 3.11 and Linux x86-64, in the versions of `constraints.txt`; of a
package from 1 MiB on. Bytecode, Taskcal itself (5 MiB) and pip (8 to 17 MiB) are not counted.
"""


def page() -> str:
    """The page."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    base = closure(project["dependencies"])
    asked = [one for extra in RUNTIME_EXTRAS for one in project["optional-dependencies"][extra]]
    everything = sum(map(size, closure(asked) | base))
    parts = [
        INTRO,
        f"With all extras: {everything:.0f} MiB.\n",
        _table("Always installed", base, project["dependencies"]),
    ]
    for extra in RUNTIME_EXTRAS:
        asked = project["optional-dependencies"][extra]
        parts.append(_table(f"With `taskcal[{extra}]`", closure(asked) - base, asked))
    return "\n".join(parts)


def closure(requirements: Iterable[str]) -> set[str]:
    """Names of the packages that are needed, and of those that they need, where they are installed here."""
    found: set[str] = set()
    open_ones = [(Requirement(one), "") for one in requirements]
    while open_ones:
        one, extra = open_ones.pop()
        name = canonicalize_name(one.name)
        if one.marker is not None and not one.marker.evaluate({"extra": extra}):
            continue
        wanted = {f"{name}[{e}]" for e in one.extras} | {name}
        if wanted <= found:
            continue
        found |= wanted
        for further in metadata(one.name).get_all("Requires-Dist") or ():
            open_ones += [(Requirement(further), e) for e in ("", *one.extras)]
    return {name for name in found if "[" not in name}


def size(name: str) -> float:
    """Of the files of an installed package, MiB, bytecode left out."""
    files = distribution(name).files or ()
    return sum(file.size or 0 for file in files if file.suffix != ".pyc") / 2**20


def licence(name: str) -> str:
    """Of an installed package, in SPDX's words where its metadata can be understood.

    Raises:
        LookupError: the metadata name none that is known here.
    """
    stated = metadata(name)
    # of a field that is not there, another package may have replaced None by an error
    expression, text = (next(iter(stated.get_all(field) or ()), "") for field in ("License-Expression", "License"))
    if expression:
        return expression
    classifiers = [one.split(" :: ")[-1] for one in stated.get_all("Classifier") or () if one.startswith("License")]
    named = [term for said in classifiers if (term := _term(said))]
    if named:
        return "; ".join(dict.fromkeys(named))
    for said in (text.split("\n")[0], " ".join(text.split())[:FIRST_WORDS]):
        if term := _term(said):
            return term
    raise LookupError(f"the licence of {name} is not known: {classifiers} {text!r:.80}")


def _term(said: str) -> str:
    """What is said of a licence, in SPDX's words; nothing where it is not understood."""
    fitting = [term for term in TERMS if re.search(rf"(?<![A-Za-z]){re.escape(term)}", said)]
    return TERMS[max(fitting, key=len)] if fitting else ""


def _table(title: str, names: set[str], asked: Iterable[str]) -> str:
    own = {canonicalize_name(Requirement(one).name) for one in asked}
    sizes = {name: size(name) for name in sorted(names)}
    under: dict[str, list[str]] = {}
    for name, mib in sizes.items():
        shown = (f"**{name}**" if name in own else name) + (f" {mib:.0f}" if mib >= 1.0 else "")
        under.setdefault(licence(name), []).append(shown)
    rows = [f"| {terms} | {', '.join(packages)} |" for terms, packages in sorted(under.items())]
    head = [f"## {title}", "", f"{sum(sizes.values()):.0f} MiB in all.", ""]
    return "\n".join([*head, "| licence | packages |", "|:--|:--|", *rows, ""])


if __name__ == "__main__":
    try:
        PAGE.write_text(page(), encoding="utf-8")
    except (LookupError, PackageNotFoundError) as error:
        sys.exit(str(error))
