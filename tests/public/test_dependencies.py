"""The list of dependencies and their licences is that of what is declared and installed."""

import platform
import re
import sys

import pytest
from packaging.utils import canonicalize_name

from docs.dependency_table import PAGE, page
from tests.public.test_release import requirements

ALLOWED = re.compile(
    r"(0BSD|Apache-2\.0|BSD-[23]-Clause(-\w+)?|CC0-1\.0|CNRI-Python|HPND|ISC|LGPL-[23]\.[01](-only|-or-later)?|MIT(-CMU|-0)?|MPL-2\.0|"
    r"PSF-2\.0|Python-2\.0(\.1)?|Unlicense|Zlib|public domain|LLVM-exception|GCC-exception-3\.1)$"
)
"""Permissive licences and those that cover a file or a library alone."""

ROWS = re.findall(r"^\| ([a-z0-9-]+) \| (yes|) \| (.+) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)


def test_every_declared_dependency_is_listed_as_such():
    asked = {canonicalize_name(name) for name in requirements("dask", "parquet", "studio", "urdf")}
    assert {name for name, own, _ in ROWS if own} == asked


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
    (sys.version_info[:2], platform.system()) != ((3, 11), "Linux"),
    reason="which packages others need depends on Python's release and the system; the list is made on Python 3.11, Linux",
)
def test_dependency_list_matches_installed_packages():
    """The page is the list that the program makes from the installed packages."""
    assert page() == PAGE.read_text(encoding="utf-8"), "make licences"
