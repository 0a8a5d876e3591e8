"""What chooses mistakes and tests, without making any."""

from pathlib import Path

from tests.mutants.__main__ import Trial, failing, trial_of
from tests.mutants.covering_tests import CoveringTests
from tests.mutants.mutations import Mutation, silent_ranges

MODULE = Path("src/taskcal/geometry/se3.py")


def test_a_trial_is_written_and_read() -> None:
    for noticed_by in ("", "tests/geometry/test_se3.py::test_a"):
        trial = Trial(Mutation(MODULE, "core/AddNot", 2, 7), 5, noticed_by)
        assert trial_of(trial.line()) == trial


def test_annotations_decorators_and_imports_are_silent() -> None:
    text = "from a import b\n@f(1)\ndef g(x: 'Float[3]' = 4) -> Literal[5]:\n    return x + 6\n"
    lines = text.splitlines()
    found = [lines[begin[0] - 1][begin[1] : end[1]] for begin, end in silent_ranges(text)]
    assert sorted(found) == ["'Float[3]'", "Literal[5]", "f(1)", "from a import b"]


def test_tests_of_a_line_come_nearest_first_and_end_in_time() -> None:
    tests = ["tests/laws/test_a.py::test_1", "tests/geometry/test_b.py::test_2", "tests/geometry/test_se3.py::test_3"]
    covering = CoveringTests({MODULE: {7: frozenset(tests)}}, dict.fromkeys(tests, 1.0), {})
    assert covering.of(MODULE, 7, longest=10) == tests[::-1]
    assert covering.of(MODULE, 7, longest=2.5) == tests[:0:-1]


def test_kernel_mutant_runs_tests_of_importers_folder_and_above() -> None:
    """The tests of a kernel are those of its importers, of its own folder and of the folders above."""
    tests = [f"tests/{file}.py::test_{k}" for file in ("geometry/test_b", "robot/test_c", "cli/test_d") for k in (1, 2)]
    importing = {MODULE: frozenset([Path("src/taskcal/robot/c.py")])}
    chosen = CoveringTests({}, dict.fromkeys(tests, 1.0), importing).of(MODULE, 7, longest=10)
    assert [test.partition("::")[0] for test in chosen] == ["tests/robot/test_c.py"] * 2 + [
        "tests/geometry/test_b.py"
    ] * 2


def test_no_tests_notice_nothing(tmp_path: Path) -> None:
    assert failing("python", tmp_path, []) == []
