"""taskcal identify --effects --field."""

from pathlib import Path

import numpy as np
import pytest

from taskcal.identification.calibration import load_calibration
from taskcal.reading.writer import write_campaign
from taskcal.report.calibration import strongest_harmonics
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import Harmonics, Thermal
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.cli.conftest import Ended, Run

ROBOT = "abb-irb120"


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot whose gears are eccentric."""
    robot = load_robot(ROBOT)
    rng = np.random.default_rng(0)
    limits = np.clip(robot.limits, -0.9, 0.9)
    q = rng.uniform(limits[:, 0], limits[:, 1], (120, len(limits)))
    measured, _ = simulate(ErrorModel(robot) + Harmonics(orders=(1,)), q, rng=rng)
    path = tmp_path_factory.mktemp("effects") / "campaign.csv"
    write_campaign(path, measured, robot)
    return path


def identify(run: Run, campaign: Path, output: Path, *options: object) -> Ended:
    return run("identify", "--robot", ROBOT, campaign, "-o", output, *options)


def test_effects_none_is_the_default(run: Run, campaign: Path, tmp_path: Path) -> None:
    plain = identify(run, campaign, tmp_path / "cal.json", "--json").json
    assert plain == identify(run, campaign, tmp_path / "cal.json", "--json", "--effects", "none").json
    assert "explanation" not in plain
    assert (plain["effects"], plain["field"]) == ([], False)
    motor = identify(run, campaign, tmp_path / "cal.json", "--effects", "motor")
    assert (motor.status, motor.out) == (1, "")
    assert "states no gear_ratio of any joint" in motor.err


def test_what_the_data_prove_is_found_saved_and_explained(run: Run, campaign: Path, tmp_path: Path) -> None:
    ended = identify(run, campaign, tmp_path / "cal.json", "--effects", "auto", "--rows", "0:40", "--json")
    result = ended.json
    assert (ended.status, ended.err) == (0, "")
    geometry, together, *effects = result["explanation"]
    assert (geometry["stage"], geometry["accepted"], geometry["log_evidence_gain"]) == ("geometry", True, None)
    assert (together["stage"], together["accepted"]) == ("all effects", True)
    assert together["log_evidence_gain"] > 10
    assert together["cross_validated_mm"] < geometry["cross_validated_mm"]
    # in a part of a turn a scale error of the encoder looks like a gear's
    assert {effect["stage"] for effect in effects if effect["accepted"]} <= {
        "gear harmonics of orders 1 to 30",
        "encoder gain",
    }
    assert effects[0]["accepted"]
    assert [effect["worth_mm"] for effect in effects] == sorted(
        (effect["worth_mm"] for effect in effects), reverse=True
    )
    assert 0.005 < result["tracker_mm"] < 0.05
    kinds = [effect["kind"] for effect in result["effects"]]
    assert {"Harmonics", "EncoderGain", "Compliance", "JointField"} <= set(kinds)
    assert [type(effect).__name__ for effect in load_calibration(tmp_path / "cal.json").model.effects] == kinds
    plain = identify(run, campaign, tmp_path / "plain.json", "--rows", "0:40", "--json").json
    assert result["held_out"]["mean_mm"] < plain["held_out"]["mean_mm"]
    checked = run("validate", tmp_path / "cal.json", campaign, "--rows", "40:", "--json").json
    assert checked["mean_mm"] == pytest.approx(result["held_out"]["mean_mm"])


def test_effects_text_table_states_gain_of_each_step(run: Run, campaign: Path, tmp_path: Path) -> None:
    """The text table states the gain of each step of the model comparison."""
    ended = identify(run, campaign, tmp_path / "cal.json", "--effects", "harmonics:1,gain", "--parameters")
    text = " ".join(ended.out.split())
    assert "held-out points" in text.partition("next")[0]
    for words in ("asked for", "geometry 0.", "with gear harmonics", "tracker noise", "periods per turn"):
        assert words in text
    starts = {line.split()[0] for line in ended.out.splitlines() if line.split()}
    assert {"J2.gain", "J2.cos1"} <= starts


def test_effects_that_geometry_nearly_repeats_are_named(run: Run, tmp_path: Path) -> None:
    """In a small room the first joint's harmonic is a turn of its frame."""
    robot, rng = load_robot(ROBOT), np.random.default_rng(0)
    measured, _ = simulate(ErrorModel(robot), rng.uniform(-0.15, 0.15, (40, 6)), rng=rng)
    write_campaign(tmp_path / "small.csv", measured, robot)
    options = ["--effects", "harmonics:1", "--holdout", "0.2"]
    near = identify(run, tmp_path / "small.csv", tmp_path / "cal.json", *options, "--json").json["collinear"]
    named = {entry["name"]: entry for entry in near}
    assert named["J1.cos1"]["explained_by"].keys() == {"J1.rz"}
    assert named["J1.cos1"]["share"] > 0.999
    assert named["J1.cos1"]["variance_inflation"] > 1000
    text = " ".join(identify(run, tmp_path / "small.csv", tmp_path / "cal.json", *options).out.split())
    assert "poorly determined at the fitted poses J" in text
    assert f"and {len(near) - 4} more" in text
    assert "% explained by J" in text


def test_a_field_is_taken_only_where_it_predicts_better(run: Run, campaign: Path, tmp_path: Path) -> None:
    ended = identify(
        run, campaign, tmp_path / "cal.json", "--effects", "harmonics:1", "--field", "--rows", "0:60", "--json"
    )
    assert ended.status == 0
    result = ended.json
    geometry, asked, together, field = result["explanation"]
    assert (geometry["stage"], asked["stage"]) == ("geometry", "gear harmonics of order 1")
    assert (together["stage"], field["stage"]) == ("all effects", "smooth field")
    assert together["accepted"] == result["field"]
    better = together["cross_validated_mm"] < asked["cross_validated_mm"]
    assert together["accepted"] == (better and "neighbouring poses left out together worse" not in together["reason"])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--effects", "auto", "--prior", "none"], "needs a prior"),
    ],
)
def test_wrong_usage_is_told_before_anything_is_computed(
    run: Run, campaign: Path, tmp_path: Path, options: list[str], words: str
) -> None:
    ended = identify(run, campaign, tmp_path / "cal.json", *options)
    assert (ended.status, ended.out) == (2, "")
    assert words in " ".join(ended.err.replace("│", " ").split())
    assert not (tmp_path / "cal.json").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--effects", "periodic,harmonics:4-5"], "add each effect once"),
        (
            ["--effects", "thermal"],
            "campaign.csv has no temperatures, which the effect 'thermal' needs; add a column temp_C",
        ),
        (["--effects", "warmup"], "campaign.csv has no times, which the effect 'warmup' needs; add a column time_s"),
    ],
)
def test_what_the_data_cannot_give_is_told(
    run: Run, campaign: Path, tmp_path: Path, options: list[str], words: str
) -> None:
    ended = identify(run, campaign, tmp_path / "cal.json", *options)
    assert (ended.status, ended.out) == (1, "")
    assert ended.err.startswith("error:")
    assert words in ended.err
    assert not (tmp_path / "cal.json").exists()


def test_expansion_is_told_from_temperatures_and_used_at_others(run: Run, tmp_path: Path) -> None:
    """The reference is the campaign's mean temperature; another campaign is predicted at its own."""
    robot = load_robot(ROBOT)
    rng = np.random.default_rng(3)
    limits = np.clip(robot.limits, -0.9, 0.9)
    model = ErrorModel(robot) + Thermal(reference=24.0)
    x = np.zeros(len(model))
    x[len(model) - 7] = 2e-5  # thermal.expansion
    paths: list[Path] = []
    for name, warmth in (("mild", np.linspace(19.0, 29.0, 60)), ("hot", np.full(30, 44.0))):
        q = rng.uniform(limits[:, 0], limits[:, 1], (len(warmth), len(limits)))
        measured, _ = simulate(model, q, rng=rng, x=x, conditions=Conditions(temperature=warmth))
        paths.append(tmp_path / f"{name}.csv")
        write_campaign(paths[-1], measured, robot)
    result = identify(run, paths[0], tmp_path / "cal.json", "--effects", "thermal", "--json").json
    assert result["effects"][0]["reference"] == 24.0
    expansion = next(p for p in result["parameters"] if p["name"] == "thermal.expansion")
    assert expansion["unit"] == "µm/m/K"
    assert abs(expansion["estimate_um_per_m_per_k"] - 20.0) < 3.0 * expansion["standard_error_um_per_m_per_k"] < 20.0
    identify(run, paths[0], tmp_path / "plain.json")
    told, plain = (run("validate", tmp_path / f"{name}.json", paths[1], "--json").json for name in ("cal", "plain"))
    assert told["mean_mm"] < 0.3 * plain["mean_mm"]


def test_amplitudes_of_harmonics() -> None:
    errors = {"standard_error_mrad": 0.1}
    parameters = [
        {"name": "J1.cos2", "estimate_mrad": 3.0, **errors},
        {"name": "J1.sin2", "estimate_mrad": -4.0, **errors},
        {"name": "axis 2.cos14", "estimate_mrad": 0.0, **errors},
        {"name": "axis 2.sin14", "estimate_mrad": 6.0, **errors},
        {"name": "J1.gain", "estimate_mrad": 9.0, **errors},
    ]
    near = pytest.approx(0.1)
    assert strongest_harmonics(parameters) == [("axis 2", 14, 6.0, near), ("J1", 2, 5.0, near)]
    assert strongest_harmonics([]) == []
