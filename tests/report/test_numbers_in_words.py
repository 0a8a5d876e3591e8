"""Sentences, key numbers and tables of pages hold the numbers of what they are about, each in the unit that stands behind it."""

import re

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from taskcal.identification.held_out import HeldOut
from taskcal.observations import Point
from taskcal.planning.plan import Plan
from taskcal.planning.study import Study
from taskcal.report.calibration import describe_coverage, describe_held_out, verdict
from taskcal.report.content import Facts, TextTable
from taskcal.report.plan import plan_page
from taskcal.report.study import MAX_REASONS, MAX_ROBOTS, describe_failed
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task

MODEL = ErrorModel(load_robot("denso-hsr065a1"))
"""Of three axes that turn and one that slides."""


def numbers(said: str) -> list[float]:
    """Numbers of a text in their order."""
    return [float(found) for found in re.findall(r"(?<![\w.])\d+(?:\.\d+)?(?![\w])", said)]


errors_mm = st.floats(0.001, 50.0)


@given(
    errors_mm,
    st.floats(0.0, 50.0),
    st.none() | st.integers(1, 999),
    st.booleans(),
    st.none() | st.tuples(errors_mm, errors_mm),
)
def test_the_verdict_states_both_errors_their_ratio_and_its_points(before, after, held_out, in_space, angles) -> None:
    said = verdict("arm", before, after, held_out, in_space=in_space, angles=angles)
    assert ("3D" in said) == in_space
    assert ("optimistic" in said) == (held_out is None)
    assert ("does not fall" in said) == (after >= before)
    wanted = [
        before,
        after,
        *([before / after] if after > 0.0 else []),
        *([held_out] if held_out else []),
        *(angles or ()),
    ]
    np.testing.assert_allclose(numbers(said.replace("3D", "")), wanted, atol=0.051)
    np.testing.assert_allclose(numbers(said.replace("3D", ""))[:2], wanted[:2], atol=5.1e-4)


def test_held_out_parts_are_stated_with_their_scatter() -> None:
    """Means of three parts of unequal size; the standard error is that of the ratio of sums over parts (Cochran 1977, eq. 6.13)."""
    mm, part = np.array([0.1, 0.3, 0.5, 0.4, 0.9, 0.2]), np.array([0, 0, 1, 1, 1, 2])
    residuals = mm[:, None, None] * np.array([0.6e-3, 0.0, -0.8e-3])
    inside = np.array([[1.0], [1.0], [0.0], [1.0], [np.nan], [1.0]])
    made = HeldOut(
        by="blocks", folds=0, rows=np.arange(6), part=part, residuals=residuals, nominal=residuals, inside=inside,
        kinds=(Point,),
    )  # fmt: skip
    means = [mm[part == k].mean() for k in range(3)]
    own = np.array([mm[part == k].sum() - np.sum(part == k) * mm.mean() for k in range(3)])
    error = np.sqrt(3.0 / 2.0 * np.sum(own**2)) / 6.0
    said = numbers(describe_held_out(made))
    np.testing.assert_allclose(said, [3, mm.mean(), error, min(means), max(means), 95, 80.0, 4, 5], atol=5.1e-4)
    assert numbers(describe_coverage(inside)) == [95.0, 80.0, 4.0, 5.0]


@given(st.lists(st.tuples(st.integers(0, 14), st.sampled_from("abcde")), min_size=1, max_size=40))
def test_campaigns_that_failed_are_counted_by_reason(failed) -> None:
    rows = tuple({"robot": robot, "failed": f"reason {reason}", "learnt": True} for robot, reason in failed)
    made = Study(rows=(*rows, {"robot": 0, "failed": "", "learnt": True}), robots=15, seed=0, accuracy=None)
    said = describe_failed(made)
    assert said.startswith(f"{len(rows)} of {len(rows) + 1} campaigns")
    reasons = {reason: [robot for robot, other in failed if other == reason] for _, reason in failed}
    listed = [found for found in reasons if f"reason {found}" in said]
    assert len(listed) == min(len(reasons), MAX_REASONS)
    assert min(len(reasons[one]) for one in listed) >= max(
        [len(reasons[k]) for k in reasons if k not in listed], default=0
    )
    for robots, reason in re.findall(r"robots? ((?:\d+[^:;]*)): reason (\w)", said):
        counts = {robot: reasons[reason].count(robot) for robot in dict.fromkeys(reasons[reason])}
        named = {
            int(n): int(times or 1) for n, times in re.findall(r"(\d+)(?: \((\d+) campaigns\))?(?=,| and|$)", robots)
        }
        more = re.search(r"and (\d+) more", robots)
        assert len(named) + (int(more[1]) if more else 0) == len(counts)
        assert len(named) <= MAX_ROBOTS
        assert all(counts[robot] == times for robot, times in named.items())


def test_the_page_of_a_plan_has_its_numbers_in_millimetres_and_degrees() -> None:
    q = np.array([[0.5, -0.25, 0.0625, 1.0], [0.1, 0.2, -0.03, -0.4]])
    made = Plan(
        q=q, rows=(4, 1), visible=np.array([[True, False, True], [True, True, True]]), expected=1.234e-4,
        random=np.array([2e-4, 4e-4]), grid=3.21e-4, by_count=np.array([9e-4, 1.5e-4]), before=1e-3, criterion="task",
        exchanges=0, accuracy=2e-4, model_error=1e-5, candidates=77, lost={"unseen": 5},
    )  # fmt: skip
    task = Task(name="list", poses=np.eye(4)[None])
    told = {**made.summary(), "task": task.name, "measured_before": 0, "visible": [["a", "c"], ["a", "b", "c"]]}
    page = plan_page(MODEL, task, made, told, seed=0)
    blocks = [block for section in page.sections for block in section.blocks]
    (key,) = (block for block in blocks if isinstance(block, Facts))
    said = {label: numbers(text) for label, text in key.items}
    assert said["accuracy"][-1] == 0.2
    assert said["model error"] == [0.01]
    np.testing.assert_allclose(said["single pose"][0], made.expected_at_a_pose * 1e3, atol=5.1e-4)
    assert said["candidates"] == [77, 5]
    expected, by_count, poses = (block for block in blocks if isinstance(block, TextTable))
    assert [row[1] for row in expected.rows] == ["0.123", "0.300", "0.321", "1.000"]
    assert [numbers(row[2]) for row in expected.rows] == [[], [0.2, 0.4], [], []]
    assert [(int(row[0]), float(row[1])) for row in by_count.rows] == [(2, 0.15)]
    scale = np.where(MODEL.robot.prismatic, 1e3, 180.0 / np.pi)
    np.testing.assert_allclose([[float(cell) for cell in row[1:5]] for row in poses.rows], q * scale, atol=6e-3)
    assert [row[-1] for row in poses.rows] == ["a, c", "a, b, c"]
