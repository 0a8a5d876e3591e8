"""Which files of tests a change touches."""

from collections.abc import Mapping

import pytest

from tests.touched import READ_PAGES, imports_of_files, touched_tests


@pytest.fixture(scope="module")
def imports() -> Mapping[str, set[str]]:
    return imports_of_files()


def test_touched_tests_import_what_changed(imports: Mapping[str, set[str]]) -> None:
    found = touched_tests({"src/taskcal/planning/fleet.py"}, imports)
    assert "tests/planning/test_fleet.py" in found
    assert "tests/identification/test_coverage.py" not in found
    assert "tests/identification/test_coverage.py" in touched_tests({"src/taskcal/kernels/walk.py"}, imports)
    assert touched_tests({"tests/geometry/test_se3.py"}, imports) == ["tests/geometry/test_se3.py"]


def test_a_module_that_is_loaded_by_name_touches_tests(imports: Mapping[str, set[str]]) -> None:
    assert "tests/cli/commands/test_demo.py" in touched_tests({"src/taskcal/cli/commands/demo.py"}, imports)


def test_everything_is_touched_where_it_cannot_be_told(imports: Mapping[str, set[str]]) -> None:
    for changed in (None, {"pyproject.toml"}, {"src/taskcal/robot/catalogue/ur5.toml"}, {"tests/conftest.py"}):
        assert touched_tests(changed, imports) == ["tests"]


def test_a_page_touches_tests_that_read_pages(imports: Mapping[str, set[str]]) -> None:
    assert touched_tests({"docs/laws.md"}, imports) == [*READ_PAGES]
    assert touched_tests((), imports) == []
