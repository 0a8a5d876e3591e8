"""The list of dependencies and their licences is that of what is declared and installed."""

import platform
import re
import sys

import pytest
from packaging.utils import canonicalize_name

from docs.dependency_table import PAGE, RUNTIME_EXTRAS, page
from tests.public.test_release import requirements

ALLOWED = re.compile(
    r"(0BSD|Apache-2\.0|BSD-[23]-Clause(-\w+)?|CC0-1\.0|CNRI-Python|HPND|ISC|LGPL-[23]\.[01](-only|-or-later)?|MIT(-CMU|-0)?|MPL-2\.0|"
    r"PSF-2\.0|Python-2\.0(\.1)?|Unlicense|Zlib|public domain|LLVM-exception|GCC-exception-3\.1)$"
)
"""Permissive licences and those that cover a file or a library alone."""

TEXT = PAGE.read_text(encoding="utf-8")
ROWS = [
    (package.split()[0].strip("*"), package.startswith("**"), stated)
    for stated, packages in re.findall(r"^\| (?!licence)(\w[^|]*) \| (.+) \|$", TEXT, re.MULTILINE)
    for package in packages.split(", ")
]
TOTALS = dict(re.findall(r"^## (.+)\n\n(\d+) MiB in all", TEXT, re.MULTILINE))

MAX_RUNTIME_MIB = 450
"""Of what Taskcal needs without extras: Numba with LLVM, SciPy and NumPy are 370 of it."""


def test_every_declared_dependency_is_listed_as_such():
    asked = {canonicalize_name(name) for name in requirements(*RUNTIME_EXTRAS)}
    assert {name for name, own, _ in ROWS if own} == asked


def test_runtime_without_extras_keeps_its_size():
    assert int(TOTALS["Always installed"]) <= MAX_RUNTIME_MIB


def test_every_licence_lets_taskcal_be_used_under_its_own():
    for name, _, stated in ROWS:
        if name == "docutils":  # of which the page says what the GPL covers
            stated = stated.replace("; GPL-3.0-or-later", "")
        alternatives = [one.strip("() ") for one in re.split(r" OR ", stated)]
        fits = [
            all(ALLOWED.match(part.strip("() ")) for part in re.split(r" AND | WITH |; ", one)) for one in alternatives
        ]
        assert any(fits), f"{name}: {stated}"


@pytest.mark.skipif(
    (sys.version_info[:2], platform.system(), platform.machine()) != ((3, 11), "Linux", "x86_64"),
    reason="which packages others need depends on Python's release and the system; the list is made on Python 3.11, Linux x86-64",
)
def test_dependency_list_matches_installed_packages():
    """The page is the list that the program makes from the installed packages."""
    assert page() == TEXT, "make licences"
