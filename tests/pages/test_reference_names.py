"""Every public name has a page, made from itself; what makes them needs Sphinx."""

import importlib
import sys
from typing import Any

import pytest

import robot_programs
import taskcal
from tests.pages.test_documents import DOCS

pytestmark = [pytest.mark.browser, pytest.mark.long]


@pytest.fixture(scope="module", name="pages")
def pages_of_names() -> Any:
    sys.path.insert(0, str(DOCS))
    return importlib.import_module("api_pages")


def test_every_public_name_is_on_one_page(pages: Any) -> None:
    listed = [full for names in pages.public_names().values() for full in names]
    assert len({id(pages._found(full)) for full in listed}) == len(listed)
    files = [name.lower() for name in pages.pages()]
    assert len(files) == len(set(files)) == len(listed) + 1
    paged = {id(pages._found(full)) for full in listed}
    spaces = [getattr(taskcal, name) for name in set(dir(taskcal)) - set(taskcal.__all__) - {"__version__"}]
    for space in (taskcal, robot_programs, *spaces):
        assert [name for name in getattr(space, "__all__", ()) if id(getattr(space, name)) not in paged] == []


def test_every_name_has_a_docstring(pages: Any) -> None:
    listed = [full for names in pages.public_names().values() for full in names]
    assert [full for full in listed if not pages._summary(full)] == []
