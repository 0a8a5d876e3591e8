"""Calibration files: back to the last bit, and refused with a reason where they are broken."""

import json
from dataclasses import dataclass, replace

import numpy as np
import pytest

from taskcal.errors import FileError, TaskcalError
from taskcal.identification.calibration import Calibration, load_calibration
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Harmonics
from taskcal.robot.error_model import ErrorModel
from tests.laws.campaigns import measure
from tests.laws.robots import irb6660_positions

KINDS = {
    "one target": {},
    "lost beams": {"targets": 3, "lost": 0.2},
    "poses": {"pose": True, "rotation_sigma": 5e-5},
}


OPTIONS = {
    "default": {},
    "some parameters": {"keep": ["J2", "loop"]},
    "no prior": {"prior": None},
    "held frames": {"frames": "fixed"},
}


def calibration(seed=0, *, kind="one target", **options) -> Calibration:
    rng = np.random.default_rng(seed)
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    x = rng.normal(size=len(model)) * model.tolerances
    campaign, _ = measure(rng, model, irb6660_positions(rng, 50), x, sigma=3e-5, **KINDS[kind])
    return identify(model, campaign, **options)


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A calibration and the content of its file."""
    found = calibration()
    path = tmp_path_factory.mktemp("saved") / "cal.json"
    found.save(path)
    return found, path.read_text(encoding="utf-8")


ARRAYS = (
    "z",
    "z_covariance",
    "T_tracker_base",
    "T_tool_target",
    "residuals",
    "studentised",
    "estimate",
    "covariance",
    "standard_errors",
    "correlation",
)


OTHERS = (
    "names",
    "kept",
    "all_names",
    "targets",
    "outliers",
    "left_out",
    "ids",
    "model_error",
    "prior_scale",
    "iterations",
    "rounds",
    "reason",
    "provenance",
)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("options", OPTIONS)
def test_a_saved_calibration_loads_to_the_last_bit(tmp_path, kind, options):
    found = calibration(kind=kind, **OPTIONS[options])
    path = tmp_path / "cal.json"
    found.save(path)
    again = load_calibration(path)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(again, name), getattr(found, name), err_msg=name)
    for name in OTHERS:
        assert getattr(again, name) == getattr(found, name), name
    assert again.model.robot.digest == found.model.robot.digest
    q = irb6660_positions(np.random.default_rng(1), 20)
    np.testing.assert_array_equal(again.predict(q), found.predict(q))
    np.testing.assert_array_equal(again.predict_covariance(q), found.predict_covariance(q))
    again.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_calibration_file_is_json_with_format_version_and_units(saved):
    """A calibration file is plain JSON that names its format, version, units and parameters."""
    found, text = saved
    data = json.loads(text, parse_constant=lambda constant: pytest.fail(f"{constant} is not JSON"))
    assert data["format"] == "taskcal-calibration"
    assert data["format_version"] == 10
    assert data["units"] == "metres and radians"
    assert data["names"] == list(found.all_names)
    assert data["provenance"]["rows"] == 50
    assert data["provenance"]["robot"] == "abb-irb6660-205-1.9"


def edit(text, *path, value=None, remove=False):
    data = json.loads(text)
    place = data
    for key in path[:-1]:
        place = place[key]
    if remove:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return json.dumps(data)


def other(text, key, change):
    """The file with a matrix or list changed."""
    data = json.loads(text)
    data[key] = change(data[key])
    return json.dumps(data)


def scaled(T):
    return [[1.001 * c if i < 3 and j < 3 else c for j, c in enumerate(row)] for i, row in enumerate(T)]


def mirrored(T):
    return [[-c if j == 0 else c for j, c in enumerate(row)] for row in T]


HELD_OUT = {
    "by": "blocks", "folds": 0, "rows": [3], "part": [0], "residuals": [[[0.0, 0.0, 1e-4]]], "nominal": [[[0.0, 0.0, 1e-3]]],
}  # fmt: skip

BROKEN = {
    "scaled frame": (
        lambda text: other(text, "T_tracker_base", scaled),
        r"'T_tracker_base' is not a rigid transform: its axes have length 1\.001",
    ),
    "mirrored frame": (
        lambda text: other(text, "T_tracker_base", mirrored),
        "'T_tracker_base' is not a rigid transform",
    ),
    "sheared target": (
        lambda text: edit(text, "T_tool_target", 0, 0, 1, value=0.5),
        "'T_tool_target' 1 is not a rigid transform",
    ),
    "frame with another last row": (
        lambda text: edit(text, "registration", "T_tracker_base", 3, 0, value=1.0),
        "'registration, T_tracker_base' is not a rigid transform",
    ),
    "names reversed": (
        lambda text: other(text, "names", lambda n: n[::-1]),
        r"'names' 1 is '\w+\.tz', where 'J1\.tx' belongs",
    ),
    "unknown name": (
        lambda text: edit(text, "names", 2, value="J9.tx"),
        r"'names' 3 is 'J9\.tx', where 'J1\.tz' belongs",
    ),
    "one name less": (lambda text: other(text, "names", lambda n: n[1:]), r"'names' has \d+ entries, .* are \d+"),
    "other units": (
        lambda text: edit(text, "units", value="millimetres"),
        "units: must be 'metres and radians' .got 'millimetres'",
    ),
    "negative prior": (
        lambda text: edit(text, "prior_scale", value=-1.0),
        r"prior_scale: must be above 0 \(got -1\.0\)",
    ),
    "negative model error": (
        lambda text: edit(text, "model_error", 0, value=-1e-4),
        r"model_error 1: must be 0 or more \(got -0\.0001\)",
    ),
    "a changed robot": (
        lambda text: edit(text, "robot", "joint", 0, "limits_deg", value=[-10.0, 10.0]),
        "its robot was changed: its digest is",
    ),
    "endless iterations": (
        lambda text: edit(text, "iterations", value=float("inf")),
        r"iterations: is not a whole number; .*\(got inf\)",
    ),
    "number as text": (lambda text: edit(text, "rounds", value="3"), r"rounds: is not a whole number.*\(got '3'\)"),
    "flag as text": (
        lambda text: edit(text, "pose", value="false"),
        r"pose: is neither true nor false \(got 'false'\)",
    ),
    "outlier of text": (
        lambda text: edit(text, "outliers", value=["much"]),
        r"outliers 1: is not a table of keys and values \(got 'much'\)",
    ),
    "effects of numbers": (lambda text: edit(text, "effects", value=[3]), "effects 1: is not a table"),
    "effect without kind": (lambda text: edit(text, "effects", value=[{}]), "effect 1 lacks 'kind'"),
    "effect with wrong options": (
        lambda text: edit(text, "effects", value=[{"kind": "Harmonics", "mood": 1}]),
        "effect 1 is none: .*mood",
    ),
    "robot of text": (lambda text: edit(text, "robot", value="ur5"), "robot: is not a table of keys and values"),
    "an integer of 5000 digits": (
        lambda text: text.replace('"rounds": ', '"rounds": ' + "9" * 5000),
        "a number has too many digits",
    ),
    "deep brackets": (lambda text: "[" * 100_000, "its JSON is nested too deeply"),
    "empty": (lambda text: "", r"cal\.json:1: is not a whole JSON file.*cut off"),
    "truncated": (
        lambda text: text[: len(text) // 2],
        r"cal\.json:\d+: is not a whole JSON file.*cut off: save the calibration again",
    ),
    "no JSON": (
        lambda text: "id,J1_deg\n1,2\n",
        r"cal\.json: is not JSON, and no calibration; give a file that taskcal identify wrote",
    ),
    "a list": (lambda text: "[1, 2]", "is JSON, but not a calibration: 'format' is not 'taskcal-calibration'"),
    "foreign": (lambda text: '{"format": "other"}', "is JSON, but not a calibration"),
    "later version": (
        lambda text: edit(text, "format_version", value=99),
        "has format version 99, this Taskcal reads 10; identify again",
    ),
    "earlier version": (
        lambda text: edit(text, "format_version", value=7),
        "has format version 7, this Taskcal reads 10; identify again",
    ),
    "no version": (lambda text: edit(text, "format_version", remove=True), "has format version None"),
    "no robot": (
        lambda text: edit(text, "robot", remove=True),
        r"cal\.json: robot: is missing; it may have been edited: identify again",
    ),
    "robot edited": (
        lambda text: edit(text, "robot", "joint", 0, "name", value="J2"),
        "its robot: .*two joints are named 'J2'",
    ),
    "unknown parameter": (lambda text: edit(text, "kept", 0, value="J9.tx"), r"no parameter 'J9\.tx'"),
    "estimate shortened": (
        lambda text: edit(text, "estimate", value=[0.0]),
        r"is inconsistent: 'estimate' has shape \(1,\), not",
    ),
    "estimate of text": (lambda text: edit(text, "estimate", 0, value="much"), "estimate 1: is not a number.*much"),
    "estimate with a gap": (lambda text: edit(text, "estimate", 0, value=None), "estimate 1: is not a number"),
    "no factor": (
        lambda text: edit(text, "covariance_factor", remove=True),
        "covariance_factor: is missing",
    ),
    "factor with a gap": (
        lambda text: edit(text, "covariance_factor", 3, 2, value=None),
        "covariance_factor 4 3: is not a number",
    ),
    "factor with a longer row": (
        lambda text: edit(text, "covariance_factor", 1, value=[0.0, 0.0, 0.0]),
        "is inconsistent: 'covariance_factor' 2 has 3 numbers, not 2",
    ),
    "factor with a row less": (
        lambda text: other(text, "covariance_factor", lambda rows: rows[:-1]),
        r"is inconsistent: 'covariance_factor' has shape \((\d+), \1\), not \((\d+), \2\)",
    ),
    "frame with a gap": (
        lambda text: edit(text, "T_tracker_base", 0, 0, value=None),
        "T_tracker_base 1 1: is not a number",
    ),
    "ids of other rows": (lambda text: edit(text, "ids", value=["a"]), "is inconsistent: 'q' has shape"),
    "residuals of other rows": (
        lambda text: other(text, "residuals", lambda residuals: residuals[1:]),
        "is inconsistent: 'residuals' has shape",
    ),
    "provenance edited": (
        lambda text: edit(text, "provenance", "mood", value="good"),
        "provenance: 'mood' is not a known key",
    ),
    "joints of other rows": (lambda text: other(text, "q", lambda q: q[1:]), "is inconsistent: 'q' has shape"),
    "held-out rows without residuals": (
        lambda text: edit(text, "held_out", value=HELD_OUT | {"residuals": [[[None] * 3]]}),
        "'held_out, residuals' holds not a single measured point",
    ),
    "held-out rows of another number": (
        lambda text: edit(text, "held_out", value=HELD_OUT | {"part": [0, 1]}),
        r"'held_out, part' has shape \(2,\), not \(1,\)",
    ),
    "a part beyond the rows held out": (
        lambda text: edit(text, "held_out", value=HELD_OUT | {"part": [10**8]}),
        "'held_out, part' counts 100000001 parts of 1 rows",
    ),
    "rows held out in another way": (
        lambda text: edit(text, "held_out", value=HELD_OUT | {"by": "colour"}),
        "held_out, by: must be",
    ),
    "registration lost": (lambda text: edit(text, "registration", "rms", remove=True), "registration, rms: is missing"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_file_is_refused_with_a_reason(tmp_path, saved, case):
    breaking, message = BROKEN[case]
    path = tmp_path / "cal.json"
    path.write_text(breaking(saved[1]), encoding="utf-8")
    with pytest.raises(FileError, match=message):
        load_calibration(path, unsealed=True)


def test_a_missing_or_binary_file_says_so(tmp_path):
    with pytest.raises(FileError, match=r"none\.json: cannot be read"):
        load_calibration(tmp_path / "none.json")
    (tmp_path / "cal.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match=r"cal\.json: is not a calibration: it is not UTF-8 text"):
        load_calibration(tmp_path / "cal.json")


@pytest.mark.parametrize(
    "broken", [{"z": [np.nan]}, {"z_spread": [[np.inf]]}, {"T_tracker_base": np.diag([2.0, 1, 1, 1])}]
)
def test_calibration_that_could_not_be_read_is_not_written(tmp_path, saved, broken):
    """What a file holds is read back first: the file that was there stays."""
    found = saved[0]
    path = tmp_path / "cal.json"
    path.write_text("what was there")
    parts = {name: np.array(value) + 0.0 * getattr(found, name) for name, value in broken.items()}
    with pytest.raises(TaskcalError, match="the calibration is not written"):
        replace(found, **parts).save(path)
    assert path.read_text() == "what was there"
    assert list(tmp_path.iterdir()) == [path]


def test_save_rejects_options_that_json_changes(tmp_path):
    """An effect of one's own whose options JSON turns into something else."""

    @dataclass(frozen=True, kw_only=True)
    class Ordered(Harmonics, abstract=True):
        def to_json(self):
            return super().to_json() | {"mood": 1}

    model, path = ErrorModel(load_robot("abb-irb6660-205-1.9")) + Ordered(orders=(1,)), tmp_path / "cal.json"
    rng = np.random.default_rng(0)
    campaign, _ = measure(rng, model, irb6660_positions(rng, 50), np.zeros(len(model)), sigma=3e-5)
    with pytest.raises(TaskcalError, match=r"is not written, for its file could not be read: effect 1 is none: .*mood"):
        identify(model, campaign).save(path)
    assert not path.exists()


def test_a_calibration_of_nominal_lengths_saves_and_loads(tmp_path):
    rng = np.random.default_rng(0)
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"), lengths_only=True)
    campaign, _ = measure(rng, model, irb6660_positions(rng, 40), 1e-3 * rng.normal(size=6), sigma=3e-5)
    found = identify(model, campaign)
    found.save(tmp_path / "cal.json")
    again = load_calibration(tmp_path / "cal.json")
    q = irb6660_positions(rng, 10)
    assert again.names == found.names
    np.testing.assert_array_equal(again.predict(q), found.predict(q))


def test_effective_parameters_follow_from_prior_and_covariance(saved, tmp_path):
    """γ = Σ(1 − σ²/prior σ²) of the estimated parameters; a file keeps it, and a fit without a prior has none."""
    found, text = saved
    prior = found.prior_scale * found.model.tolerances
    expected = np.sum(1.0 - found.standard_errors**2 / prior**2)
    # standard errors also allow for how well the variance of a pose is known
    np.testing.assert_allclose(found.effective_parameters, expected, rtol=1e-3)
    assert 10.0 < found.effective_parameters < len(found.kept)
    assert json.loads(text)["effective_parameters"] == found.effective_parameters
    (tmp_path / "cal.json").write_text(text, encoding="utf-8")
    again = load_calibration(tmp_path / "cal.json")
    assert (again.effective_parameters, again.parameter_groups) == (found.effective_parameters, 1)
    without = calibration(prior=None)
    assert (without.effective_parameters, without.parameter_groups) == (None, None)
