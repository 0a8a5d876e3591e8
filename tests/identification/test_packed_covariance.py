"""Large covariances in files: back to the last bit, and refused with a reason where they are broken."""

import base64
import json
from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import FileError, TaskcalError
from taskcal.identification.calibration_file import load_calibration
from taskcal.identification.identify import identify
from taskcal.identification.packed_covariance import PACKED_FROM, describe_covariance, unpack_covariance
from taskcal.measurement.virtual_cell import simulate
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Harmonics
from taskcal.robot.error_model import ErrorModel


def covariance(size, seed=0):
    factor = np.random.default_rng(seed).normal(size=(size, size)) * np.logspace(-9, 0, size)[:, None]
    C = factor @ factor.T
    return 0.5 * (C + C.T)


def test_a_large_covariance_comes_back_to_the_last_bit_in_a_sixth_of_the_room():
    C = covariance(300)
    C[3, 4] = C[4, 3] = -0.0
    described = describe_covariance(C)
    again = unpack_covariance(json.loads(json.dumps(described)))
    assert again.tobytes() == C.tobytes()
    assert 4 * len(json.dumps(described)) < len(json.dumps(C.tolist()))


@pytest.mark.parametrize("size", [0, 1, PACKED_FROM - 1])
def test_small_covariances_are_left_to_be_read(size):
    assert describe_covariance(covariance(size)) == covariance(size).tolist()


def test_no_half_of_a_covariance_is_dropped_where_the_halves_differ():
    C = covariance(PACKED_FROM)
    C[0, 1] = np.nextafter(C[0, 1], np.inf)
    assert describe_covariance(C) == C.tolist()


def test_the_triangle_stands_row_by_row():
    upper = base64.b64encode(np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], dtype="<f8").tobytes()).decode()
    np.testing.assert_array_equal(
        unpack_covariance({"size": 3, "upper": upper}), [[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]]
    )


@pytest.mark.parametrize(
    ("described", "words"),
    [
        ({"size": 2}, "has the keys size, not 'size' and 'upper'"),
        ({"size": 2.0, "upper": ""}, r"the size of 'covariance' is 2\.0, not a number from 0"),
        ({"size": 10**9, "upper": ""}, "not a number from 0 to 20000"),
        ({"size": 1, "upper": "no base64"}, "is not base64"),
        ({"size": 1, "upper": None}, "is not base64"),
        ({"size": 2, "upper": base64.b64encode(bytes(16)).decode()}, "has 16 bytes, one of size 2 has 24"),
    ],
)
def test_what_is_not_a_packed_covariance_is_refused(described, words):
    with pytest.raises(TaskcalError, match=words):
        unpack_covariance(described)


def test_a_calibration_with_many_parameters_is_saved_packed_and_loads_to_the_last_bit(tmp_path):
    rng = np.random.default_rng(0)
    model = ErrorModel(load_robot("ur5"))
    campaign, _ = simulate(model, rng.uniform(-1.5, 1.5, (30, 6)), rng=rng)
    found = identify(model + Harmonics(orders=tuple(range(1, 11))), campaign)
    found = replace(found, z_covariance=0.5 * (found.z_covariance + found.z_covariance.T))
    path = tmp_path / "cal.json"
    found.save(path)
    assert set(json.loads(path.read_text())["covariance"]) == {"size", "upper"}
    again = load_calibration(path)
    assert again.z_covariance.tobytes() == found.z_covariance.tobytes()
    again.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()
    data = json.loads(path.read_text())
    data["covariance"]["size"] += 1
    path.write_text(json.dumps(data))
    with pytest.raises(FileError, match=r"cal\.json.*the upper triangle of 'covariance' has"):
        load_calibration(path)
