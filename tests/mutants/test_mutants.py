"""What chooses mistakes and tests, without making any."""

import random
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from tests.mutants.__main__ import Trial, failing, trial_of, wilson
from tests.mutants.mutations import Mutation, is_python, silent_ranges
from tests.mutants.nearest_tests import nearest_tests, package_of, shares

MODULE = Path("src/taskcal/geometry/se3.py")


def test_a_trial_is_written_and_read() -> None:
    for noticed_by in ("", "tests/geometry/test_se3.py::test_a"):
        trial = Trial(Mutation(MODULE, "core/AddNot", 2, 7), 5, noticed_by)
        assert trial_of(trial.line()) == trial


def test_annotations_decorators_and_imports_are_silent() -> None:
    text = (
        "from a import b\n@f(1)\ndef g(x: 'Float[3]' = 4, *, y=zip(2, strict=True)) -> Literal[5]:\n    return x * 6\n"
    )
    lines = text.splitlines()
    found = [lines[begin[0] - 1][begin[1] : end[1]] for begin, end in silent_ranges(text)]
    assert sorted(found) == ["'Float[3]'", "*", "Literal[5]", "True", "f(1)", "from a import b"]


def test_what_is_no_python_is_told() -> None:
    assert is_python("a = {1: 2, **b}\n")
    assert not is_python("a = {1: 2, *b}\n")


def test_tests_of_a_module_are_its_own_then_the_nearest() -> None:
    needs = {
        "tests/geometry/test_a.py": {"tests/laws/b.py"},
        "tests/laws/b.py": {str(MODULE)},
        "tests/geometry/test_c.py": {str(MODULE)},
        "tests/geometry/test_se3.py": {"tests/laws/b.py"},
        "tests/robot/test_d.py": {"tests/geometry/test_c.py"},
        "tests/cli/test_e.py": {str(MODULE)},
        "tests/realdata/test_f.py": {str(MODULE)},
        "tests/cli/test_g.py": {"src/taskcal/other.py"},
    }
    inside, others = nearest_tests(MODULE, needs)
    assert inside == [f"tests/geometry/test_{name}.py" for name in ("se3", "c", "a")]
    assert others == ["tests/cli/test_e.py", "tests/robot/test_d.py"]


def test_shares_are_whole_and_within_one_of_the_proportion() -> None:
    rng = random.Random(3)
    for _ in range(50):
        weights = {str(k): rng.randint(1, 900) for k in range(rng.randint(1, 30))}
        count = rng.randint(0, 400)
        given = shares(count, weights)
        assert sum(given.values()) == count
        exact = count * np.array(list(weights.values())) / sum(weights.values())
        assert np.all(np.abs(np.array(list(given.values())) - exact) < 1.0)


def test_every_module_lies_in_a_package_and_kernels_in_theirs() -> None:
    paths = (
        "src/taskcal/arguments.py",
        "src/taskcal/robot/effects/base.py",
        "src/robot_programs/krl/parse.py",
    )
    assert [package_of(Path(path)) for path in paths] == ["taskcal", "taskcal/robot", "robot_programs"]


def test_the_interval_is_wilsons() -> None:
    for noticed, tried in ((0, 4), (3, 6), (130, 153), (7, 7)):
        interval = binomtest(noticed, tried).proportion_ci(0.95, "wilson")
        np.testing.assert_allclose(wilson(noticed, tried), interval, atol=1e-4)


def test_no_tests_notice_nothing(tmp_path: Path) -> None:
    assert failing("python", tmp_path, []) == []
