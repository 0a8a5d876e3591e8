"""The page about other software holds what was measured last; an adapter finds the robot that a case was made from."""

import json
import subprocess
import sys

import numpy as np
import pytest

from benchmarks.peers import scaling
from benchmarks.peers.cases import chain_model, ur10
from benchmarks.peers.environments import ADAPTERS, PEERS, variables
from benchmarks.peers.figure import draw, draw_scaling
from benchmarks.peers.measure import JOINTS, SCALED_JOINTS, SOURCE, slope
from benchmarks.peers.page import PAGE, RESULT, placed, seconds, tables
from taskcal.robot.robot_file import robot_from


@pytest.fixture(scope="module")
def result():
    return json.loads(RESULT.read_text(encoding="utf-8"))


def test_the_page_holds_the_tables_of_the_results(result):
    text = PAGE.read_text(encoding="utf-8")
    for name, table in tables(result).items():
        assert placed(text, name, table) == text, f"{name}: run python -m benchmarks.peers --page-only"


def test_the_figure_has_a_line_for_all_that_ended(result):
    drawn = [one.name for panel in draw(result).panels for one in panel.series if len(one.x)]
    for what in ("poses", "parameters"):
        for name, rows in result[what].items():
            assert name in drawn or all("failed" in row for row in rows)


def test_a_line_of_the_passes_states_its_exponents(result):
    series = [one for panel in draw_scaling(result).panels for one in panel.series]
    assert all("(exponent " in one.name for one in series if len(one.x) > 1)
    assert {one.name.partition(" (")[0] for one in series} == {"sensitivities", "normal equations", "study"}


def test_benchmark_chains_build_in_all_sizes_and_round_trip():
    """Chains of all sizes are built, and the description of the longest one is valid."""
    for joints in (1, SCALED_JOINTS[-1]):
        assert len(chain_model(joints, np.random.default_rng(0))) == 6 * joints + 6
    longest = chain_model(JOINTS[-1], np.random.default_rng(0)).robot
    assert robot_from(longest.description).joint_names == longest.joint_names


def test_what_is_passed_over_in_blocks_is_all_of_it(monkeypatch):
    """The time of so many blocks is the sum of theirs, and every row is in one."""
    monkeypatch.setattr(scaling, "BLOCK", 20)
    monkeypatch.setattr(scaling, "best", lambda call, *, once: 0.0 if call() is None else 1.0)
    passes = scaling.Passes(model=chain_model(2, np.random.default_rng(0)), rng=np.random.default_rng(0))
    assert list(scaling.blocks(50)) == [20, 20, 10]
    assert passes.seconds(50) == {"sensitivities": 3.0, "normal equations": 3.0}


def test_nothing_of_the_workplace_is_in_the_results():
    text = RESULT.read_text(encoding="utf-8")
    assert "/tmp" not in text
    assert "/work" not in text


def test_an_adapter_finds_the_virtual_robot(tmp_path):
    """In this environment, which has all that the adapter of SciPy needs."""
    ur10().write(tmp_path)
    (peer,) = (peer for peer in PEERS if peer.adapter == "scipy_fit.py")
    command = [sys.executable, str(ADAPTERS / peer.adapter), str(tmp_path), "--start", "given", "--seconds", "0"]
    done = subprocess.run(command, env=variables(peer, SOURCE), capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    assert found["held_out_mm"] < 0.03
    assert found["parameters"] == 4 * 6 + 3  # four for each turning axis, three for the point that is measured


def test_a_slope_is_the_exponent_of_the_larger_sizes():
    rows = [{"size": n, "warm_s": 1.0 + 1e-6 * n**2} for n in (1, 10, 10_000, 100_000)]
    assert slope([*rows, {"size": 10**6, "failed": "too long"}]) == pytest.approx(2.0, abs=0.1)
    assert slope(rows[:1]) is None


def test_times_have_two_digits_and_a_unit():
    times = {2.34e-5: "23 µs", 2.34e-4: "230 µs", 0.0123: "12 ms", 0.123: "120 ms", 1.23: "1.2 s", 61.0: "61 s"}
    assert [seconds(t) for t in times] == list(times.values())
