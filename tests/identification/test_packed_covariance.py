"""Covariances in files: their factor back to the last bit, and refused with a reason where it is broken."""

import base64
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.errors import FileError, FitError, TaskcalError
from taskcal.identification.calibration import (
    PACKED_FROM,
    describe_factor,
    factor_of,
    load_calibration,
    spread_of,
    unpack_factor,
)
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate


def covariance(size, seed=0):
    factor = np.random.default_rng(seed).normal(size=(size, size)) * np.logspace(-9, 0, size)[:, None]
    return factor @ factor.T


def again(B):
    described = json.loads(json.dumps(describe_factor(B)))
    return factor_of(unpack_factor(described) if isinstance(described, dict) else described)


@pytest.mark.parametrize("size", [0, 1, PACKED_FROM - 1, PACKED_FROM, 300])
def test_factor_comes_back_to_the_last_bit(size):
    B = spread_of(covariance(size))
    B[size // 2 :, :1] *= -0.0
    assert again(B).tobytes() == B.tobytes()


def test_large_factor_takes_a_third_of_the_room_of_its_digits():
    B = spread_of(covariance(300))
    rows = [row[: i + 1].tolist() for i, row in enumerate(B)]
    assert 1.7 * len(json.dumps(describe_factor(B))) < len(json.dumps(rows))


def test_small_factors_are_left_to_be_read():
    assert describe_factor(spread_of(np.array([[4.0, 2.0], [2.0, 10.0]]))) == [[2.0], [1.0, 3.0]]


def test_triangle_stands_row_by_row():
    lower = base64.b64encode(np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], dtype="<f8").tobytes()).decode()
    assert unpack_factor({"size": 3, "lower": lower}) == [[1.0], [2.0, 3.0], [4.0, 5.0, 6.0]]


@settings(max_examples=30)
@given(st.integers(0, 10**6), st.integers(2, 60), st.floats(-16.0, 0.0), st.sampled_from(["full", "zeros", "rank"]))
def test_factor_keeps_the_variance_of_every_combination(seed, size, least, kind):
    """Of nearly and of wholly singular covariances, within what the file's documentation states."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(size, size)))[0]
    root = turn * np.sqrt(np.logspace(least, 0.0, size)) * np.logspace(-9, 0, size)[:, None]
    root[:, : size // 2] *= kind != "rank"
    root[: size // 2] *= kind != "zeros"
    C = root @ root.T
    B = spread_of(C)
    deviation = np.sqrt(np.diag(C))
    assert (np.abs(C - B @ B.T) <= STATED * np.outer(deviation, deviation)).all()
    assert np.array_equal(B, np.tril(B))
    assert (np.square(B.T @ rng.normal(size=(size, 20))).sum(axis=0) >= 0.0).all()


STATED = 1e-13


def test_save_rejects_invalid_covariance():
    """A matrix that is not a covariance is rejected before it is written."""
    C = np.array([[1.0, 0.99, -0.99], [0.99, 1.0, 0.99], [-0.99, 0.99, 1.0]])
    for wrong in (C, np.diag([1.0, -1e-12]), np.array([[0.0, 1e-3], [1e-3, 1.0]]), np.full((2, 2), np.nan)):
        with pytest.raises(FitError, match="the covariance of the fit is none"):
            spread_of(wrong)


@pytest.mark.parametrize(
    ("described", "words"),
    [
        ({"size": 2}, "has the keys size, not 'size' and 'lower'"),
        ({"size": 2.0, "lower": ""}, r"the size of 'covariance_factor' is 2\.0, not a number from 0"),
        ({"size": 10**9, "lower": ""}, "not a number from 0 to 20000"),
        ({"size": 1, "lower": "no base64"}, "is not base64"),
        ({"size": 1, "lower": None}, "is not base64"),
        ({"size": 2, "lower": base64.b64encode(bytes(16)).decode()}, "has 16 bytes, one of size 2 has 24"),
    ],
)
def test_what_is_not_a_packed_factor_is_refused(described, words):
    with pytest.raises(TaskcalError, match=words):
        unpack_factor(described)


def test_large_calibration_is_packed_and_round_trips_exactly(tmp_path):
    """A calibration with many parameters is saved packed and loaded to the last bit."""
    rng = np.random.default_rng(0)
    model = ErrorModel(load_robot("ur5"))
    campaign, _ = simulate(model, rng.uniform(-1.5, 1.5, (30, 6)), rng=rng)
    found = identify(model + Harmonics(orders=tuple(range(1, 11))), campaign)
    path = tmp_path / "cal.json"
    found.save(path)
    assert set(json.loads(path.read_text())["covariance_factor"]) == {"size", "lower"}
    again = load_calibration(path)
    assert again.z_covariance.tobytes() == found.z_covariance.tobytes()
    again.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()
    data = json.loads(path.read_text())
    data["covariance_factor"]["size"] += 1
    path.write_text(json.dumps(data))
    with pytest.raises(FileError, match=r"cal\.json.*the lower triangle of 'covariance_factor' has"):
        load_calibration(path, unsealed=True)
