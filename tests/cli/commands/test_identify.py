"""taskcal identify."""

import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import taskcal as tc
from taskcal.cli.commands import doctor
from taskcal.errors import TaskcalError
from taskcal.identification.calibration import COURSE_IN_DOUBT, load_calibration
from taskcal.identification.sibling import MIN_GAIN
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from taskcal.report.fit import next_steps
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.cli.conftest import IRB6660, Ended, Run
from tests.laws.urdfs import telescopic_column

ERRORS = {"mean_mm", "rms_mm", "p95_mm", "max_mm", "max_x_mm", "max_y_mm", "max_z_mm", "n"}


def identify(run: Run, campaign: Path, output: Path, *options: object, robot: object = IRB6660) -> Ended:
    return run("identify", "--robot", robot, campaign, "-o", output, *options)


@pytest.fixture
def _no_doctor(monkeypatch: pytest.MonkeyPatch) -> None:
    """Refusals alone: the doctor, whom the command asks for a hint, takes seconds and has its own tests."""

    def refused(*_: object) -> None:
        raise TaskcalError("not asked")

    monkeypatch.setattr(doctor, "diagnose_file", refused)


def test_json_of_a_fit(run: Run, cell: Path, tmp_path: Path) -> None:
    ended = identify(run, cell / "one.csv", tmp_path / "cal.json", "--json")
    result = ended.json
    assert (ended.status, ended.err) == (0, "")
    assert result["calibration"] == str(tmp_path / "cal.json")
    assert (result["robot"], result["rows"]) == (IRB6660, 60)
    assert set(result["fitted"]) == ERRORS
    assert result["held_out"] is None
    assert result["fitted"]["rms_mm"] < 0.05
    assert len(result["parameters"]) == 45
    first, turn = result["parameters"][0], result["parameters"][3]
    assert (first["name"], first["symbol"], first["unit"]) == ("J1.tx", "t1x", "mm")
    assert turn["unit"] == "mrad"
    saved = load_calibration(tmp_path / "cal.json")
    assert first["estimate_mm"] == pytest.approx(saved.estimate[0] * 1e3)
    assert turn["standard_error_mrad"] == pytest.approx(saved.standard_errors[3] * 1e3)
    assert result["model_error_mm"] == pytest.approx(saved.model_error[0] * 1e3)
    assert result["outliers"] == []
    assert result["reason"]


def test_the_report_for_people(run: Run, cell: Path, tmp_path: Path) -> None:
    text = identify(run, cell / "one.csv", tmp_path / "cal.json", "--holdout", "0.3").out
    said = " ".join(text.partition(".\n")[0].split()) + "."
    assert re.fullmatch(
        r".+: the mean 3D prediction error falls from \d\.\d{3} mm, nominal \(registered\), to \d\.\d{4} mm, calibrated "
        r"\(ratio \d+\.\d, 18 held-out points\)\.",
        said,
    ), said
    assert text.index("next ") < text.index(" calibrated   ") < text.index("Residuals of the fitted rows")
    for word in ("rms", "model error", "tracker frame", "--parameters lists them"):
        assert word in text
    assert "psi5" not in text
    whole = identify(run, cell / "one.csv", tmp_path / "cal.json", "--holdout", "0.3", "--parameters").out
    for word in ("psi5", "Largest correlations"):
        assert word in whole


def test_rows_by_range_and_by_file_are_the_same_rows(run: Run, cell: Path, tmp_path: Path) -> None:
    (tmp_path / "rows.txt").write_text("# the first forty\n\n" + "\n".join(f"{i}  # row" for i in range(40)))
    by_file = identify(run, cell / "one.csv", tmp_path / "a.json", "--rows", tmp_path / "rows.txt", "--json").json
    by_range = identify(run, cell / "one.csv", tmp_path / "a.json", "--rows", "0:40", "--json").json
    assert by_file == by_range
    assert by_file["rows"] == by_file["fitted"]["n"] == 40
    assert by_file["held_out"]["n"] == 20
    assert identify(run, cell / "one.csv", tmp_path / "a.json", "--rows", ":40", "--json").json == by_range


def test_what_is_held_out_depends_on_the_seed_alone(run: Run, cell: Path, tmp_path: Path) -> None:
    options = ["--holdout", "0.3", "--json", "--seed"]
    first, again, other = (
        identify(run, cell / "one.csv", tmp_path / "a.json", *options, seed).json for seed in (1, 1, 2)
    )
    assert first == again
    assert first["held_out"]["n"] == 18
    assert first["held_out"] != other["held_out"]
    assert (first["holdout"]["by"], first["holdout"]["parts"]) == ("neighbours", 6)
    assert first["nominal"]["mean_mm"] > 5 * first["held_out"]["mean_mm"]
    own = run("validate", tmp_path / "a.json", cell / "one.csv", "--json").json["mean_mm"]
    assert own == pytest.approx(0.7 * other["fitted"]["mean_mm"] + 0.3 * other["held_out"]["mean_mm"])


@pytest.mark.parametrize("by", ["neighbours", "blocks", "rows"])
def test_folds_hold_out_every_row_and_fit_all(run: Run, cell: Path, tmp_path: Path, by: str) -> None:
    options = ["--folds", "3", "--holdout-by", by, "--json"]
    result = identify(run, cell / "one.csv", tmp_path / "a.json", *options).json
    assert result["rows"] == result["fitted"]["n"] == result["held_out"]["n"] == result["nominal"]["n"] == 60
    assert result["holdout"]["folds"] == result["holdout"]["parts"] == 3
    assert result["holdout"]["least_mm"] < result["held_out"]["mean_mm"] < result["holdout"]["largest_mm"]
    kept = load_calibration(tmp_path / "a.json").held_out
    assert kept is not None
    assert kept.validation.summary() == result["held_out"]


def test_every_fold_finds_its_own_effects(run: Run, cell: Path, tmp_path: Path) -> None:
    options = ["--folds", "2", "--effects", "gain", "--keep", "J2,J3", "--json"]
    result = identify(run, cell / "one.csv", tmp_path / "a.json", *options).json
    assert len(result["explanation"]) == 2
    assert result["held_out"]["n"] == 60


def test_effects_that_cannot_be_tried_are_said_and_not_advised(run: Run, tmp_path: Path) -> None:
    robot, rng = tmp_path / "column.urdf", np.random.default_rng(0)
    robot.write_text(telescopic_column())
    model = ErrorModel(load_robot(robot))
    limits = np.clip(model.robot.limits, -1.5, 1.5)
    campaign, _ = simulate(model, rng.uniform(*limits.T, (40, len(limits))), rng=rng, model_error=3e-4)
    write_campaign(tmp_path / "column.csv", campaign, model.robot)
    plain = identify(run, tmp_path / "column.csv", tmp_path / "a.json", robot=robot)
    assert "--effects auto" not in plain.out
    options = ["--effects", "auto", "--holdout", "0.3"]
    shown = identify(run, tmp_path / "column.csv", tmp_path / "b.json", *options, robot=robot)
    assert "No effect was tried: all effects: column has joints that others drive (lift2)" in " ".join(
        shown.out.split()
    )
    assert "not tried" in shown.out
    assert "--effects auto" not in shown.out
    result = identify(
        run, tmp_path / "column.csv", tmp_path / "c.json", "--effects", "auto", "--json", robot=robot
    ).json
    assert "lift2" in result["not_tried"]["all effects"]
    assert (result["holdout"]["folds"], result["holdout"]["by"], result["held_out"]["n"]) == (5, "neighbours", 40)
    assert "no effect was tried" in result["remarks"][-1]


def test_advice_does_not_repeat_a_search_for_effects(run: Run, cell: Path, tmp_path: Path) -> None:
    """Errors of single poses are nothing that an effect explains: it was asked, and is not asked for again."""
    model, rng = ErrorModel(load_robot(IRB6660)), np.random.default_rng(0)
    q = read_campaign(cell / "one.csv", model.robot).q
    campaign, _ = simulate(model, q, rng=rng, model_error=3e-4)
    write_campaign(tmp_path / "noisy.csv", campaign, model.robot)
    assert "--effects auto" in identify(run, tmp_path / "noisy.csv", tmp_path / "a.json").out
    ended = identify(run, tmp_path / "noisy.csv", tmp_path / "b.json", "--effects", "auto", "--rows", "0:40")
    assert "effects were tried and are not part of the calibration" in " ".join(ended.out.lower().split())
    assert "--effects auto" not in ended.out


def test_the_nominal_lengths_alone(run: Run, cell: Path, tmp_path: Path) -> None:
    """The publication's first model: six lengths, which leave far more than the defects do."""
    result = identify(run, cell / "one.csv", tmp_path / "a.json", "--lengths-only", "--json").json
    assert [p["name"] for p in result["parameters"]] == ["RL1", "d2", "d3", "d4", "RL4", "RL6"]
    whole = identify(run, cell / "one.csv", tmp_path / "b.json", "--json").json
    assert result["fitted"]["rms_mm"] > 3.0 * whole["fitted"]["rms_mm"]
    predicted = run("validate", tmp_path / "a.json", cell / "one.csv", "--json").json
    assert predicted["rms_mm"] == pytest.approx(result["fitted"]["rms_mm"])


@pytest.mark.parametrize("campaign", ["three.csv", "poses.csv"])
def test_identify_fits_three_reflectors_and_poses(run: Run, cell: Path, tmp_path: Path, campaign: str) -> None:
    result = identify(run, cell / campaign, tmp_path / "cal.json", "--json", "--rows", "0:25").json
    assert result["held_out"]["rms_mm"] < 0.15
    assert result["held_out"]["n"] == (15 if campaign == "three.csv" else 5)
    assert ("mean_mrad" in result["held_out"]) == ("model_error_mrad" in result) == (campaign == "poses.csv")
    assert identify(run, cell / campaign, tmp_path / "cal.json").status == 0


J2 = [f"J2.{component}" for component in ("tx", "ty", "tz", "rx", "ry", "rz")]


@pytest.mark.parametrize(
    ("options", "targets", "names"),
    [
        (["--targets", "smr3,smr1", "--keep", "J2,psi5,loop.rod"], ["smr3", "smr1"], [*J2, "J5.ry", "loop.rod"]),
        (
            ["--keep", "J2.tx,J3.rz", "--effects", "gain", "--holdout", "0.3"],
            None,
            ["J2.tx", "J3.rz", *(f"J{j}.gain" for j in range(1, 7))],
        ),
        (["--keep", "published", "--prior", "none"], None, 33),
    ],
    ids=["targets and parameters", "effects stay", "published"],
)
def test_identify_keeps_the_parameters_asked_for(
    run: Run, cell: Path, tmp_path: Path, options: list[str], targets: list[str] | None, names: list[str] | int
) -> None:
    result = identify(run, cell / "three.csv", tmp_path / "a.json", *options, "--json").json
    assert list(result["targets"]) == (targets or ["smr1", "smr2", "smr3"])
    found = [parameter["name"] for parameter in result["parameters"]]
    assert (len(found) if isinstance(names, int) else found) == names
    assert (result["prior_scale"] is None) == ("none" in options)


@pytest.mark.parametrize("campaign", ["one.csv", "poses.csv"])
def test_the_nominal_robot_in_its_registered_frame(run: Run, cell: Path, tmp_path: Path, campaign: str) -> None:
    """Nothing is estimated at all: the residuals of the registration."""
    result = identify(run, cell / campaign, tmp_path / "cal.json", "--keep", "none", "--frames", "fixed", "--json").json
    assert (result["reason"], result["correlations"]) == ("nothing was to be estimated", [])
    assert all(
        parameter["estimate_mm" if parameter["unit"] == "mm" else "estimate_mrad"] == 0.0
        for parameter in result["parameters"]
    )
    fitted = identify(run, cell / campaign, tmp_path / "all.json", "--json").json["fitted"]["rms_mm"]
    assert result["fitted"]["rms_mm"] > 2.0 * fitted
    assert identify(run, cell / campaign, tmp_path / "cal.json", "--keep", "none", "--frames", "fixed").status == 0


def test_options_reach_the_fit(run: Run, cell: Path, tmp_path: Path) -> None:
    options = [
        "--model-error-mm",
        "0.05",
        "--prior-scale",
        "2",
        "--frames",
        "fixed",
        "--mpe-to-sigma",
        "0.577",
    ]
    result = identify(run, cell / "one.csv", tmp_path / "a.json", *options, "--json").json
    assert result["model_error_mm"] == pytest.approx(0.05)
    assert result["prior_scale"] == pytest.approx(2.0)
    options = load_calibration(tmp_path / "a.json").provenance.options
    assert options["frames"] == "fixed"


def test_a_sibling_is_read_named_and_not_overwritten(run: Run, cell: Path, tmp_path: Path) -> None:
    """A few rows of a robot are fitted as those of one of its make; the JSON and a remark name its file."""
    other = tmp_path / "other.json"
    identify(run, cell / "one.csv", other)
    ended = identify(run, cell / "one.csv", tmp_path / "a.json", "--rows", "0:20", "--like", other, "--json")
    like = ended.json["like"]
    assert (ended.status, like["file"], like["rows"]) == (0, "other.json", 60)
    assert like["taken"] == (like["log_evidence_gain"] > MIN_GAIN)
    assert "other.json" in ended.json["remarks"][-1]
    before = other.read_bytes()
    assert identify(run, cell / "one.csv", other, "--like", other).status != 0
    missing = identify(run, cell / "one.csv", tmp_path / "b.json", "--like", tmp_path / "none.json")
    assert missing.status == 1
    assert "none.json" in missing.err
    assert other.read_bytes() == before


@pytest.mark.parametrize(
    "options",
    [
        ["--rows", "0:40", "--holdout", "0.3"],
        ["--rows", "40:0"],
        ["--rows", "a:b"],
        ["--rows", "1:2:3"],
        ["--rows", "-5:10"],
        ["--rows", "60"],
        ["--holdout", "0"],
        ["--holdout", "1.5"],
        ["--holdout", "0.3", "--folds", "3"],
        ["--folds", "1"],
        ["--rows", "0:40", "--folds", "3"],
        ["--holdout-by", "rows"],
        ["--holdout", "0.3", "--holdout-by", "colour"],
        ["--prior", "none", "--prior-scale", "2"],
        ["--like", "other.json", "--prior", "none"],
        ["--prior", "flat"],
        ["--model-error-mm", "-1"],
        ["--model-error-mm", "1e308"],
        ["--prior-scale", "1e-320"],
        ["--prior-scale", "1e308"],
        ["--mpe-to-sigma", "0"],
        ["--targets", "smr1,,smr2"],
        ["--keep", "J1,J1"],
    ],
    ids=" ".join,
)
def test_wrong_usage(run: Run, cell: Path, tmp_path: Path, options: list[str]) -> None:
    ended = identify(run, cell / "one.csv", tmp_path / "a.json", *options)
    assert (ended.status, ended.out) == (2, "")
    assert options[0] in ended.err
    assert not (tmp_path / "a.json").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--rows", "0:61"], "has 60 rows, numbered 0 to 59; write 0:60"),
        (["--rows", "70:"], "has 60 rows, numbered 0 to 59"),
        (["--rows", "0:2"], "2 measured points in 2 rows are too few"),
        (["--rows", "nowhere.txt"], "nowhere.txt: cannot be read"),
        (["--targets", "smr1"], "one.csv:1: has no target 'smr1'; it has tool"),
        (["--keep", "J7.tx"], "no parameter 'J7.tx' in abb-irb6660-205-1.9; joint frames run from J1 to J6"),
        (["--holdout", "0.001"], "holding out 0.001 of 60 rows leaves 60 to fit and 0 to test"),
    ],
)
@pytest.mark.usefixtures("_no_doctor")
def test_what_the_data_cannot_give(run: Run, cell: Path, tmp_path: Path, options: list[str], message: str) -> None:
    ended = identify(run, cell / "one.csv", tmp_path / "a.json", *options)
    assert (ended.status, ended.out) == (1, "")
    assert ended.err.startswith("error: ")
    assert message in ended.err


def edited(source: Path, target: Path, row: int | None, column: str, cell: str) -> None:
    """Write a cell, or with row None rename the column."""
    lines = [line.split(",") for line in source.read_text().splitlines()]
    lines[0 if row is None else row + 1][lines[0].index(column)] = cell
    target.write_text("\n".join(",".join(cells) for cells in lines))


@pytest.mark.parametrize(
    ("row", "column", "text", "message"),
    [
        (4, "J2_deg", "12;5", "bad.csv:6: column 'J2_deg': '12;5' is not a number"),
        (4, "J2_deg", "", "bad.csv:6: column 'J2_deg': the cell is empty"),
        (4, "J2_deg", "95", "bad.csv:6: J2 = 95.000° is outside -42 to 85°"),
        (4, "y_mm", "", "bad.csv:6: column 'y_mm': the cell is empty while its target's others are not"),
        (4, "id", "3", "bad.csv:6: column 'id': id '3' stands in line 5 already"),
        (None, "J4_deg", "J7_deg", f"bad.csv:1: 'J7_deg' is a joint that {IRB6660} does not have; it has 6"),
        (None, "J4_deg", "elbow", "bad.csv:1: has no column for joint J4"),
        (None, "J4_deg", "J4", "bad.csv:1: column 'J4': the unit is not stated; name the column J4_deg"),
        (None, "z_mm", "depth", "bad.csv:1: has 'x_mm' but no column 'z_mm'"),
        (
            None,
            "z_mm",
            "z_in",
            "bad.csv:1: the axes of one target have different units: 'x_mm' (mm), 'y_mm' (mm), 'z_in' (in); "
            "give all three in one unit\n",
        ),
    ],
)
@pytest.mark.usefixtures("_no_doctor")
def test_a_campaign_that_is_wrong(
    run: Run, cell: Path, tmp_path: Path, row: int | None, column: str, text: str, message: str
) -> None:
    edited(cell / "one.csv", tmp_path / "bad.csv", row, column, text)
    ended = identify(run, tmp_path / "bad.csv", tmp_path / "a.json")
    assert (ended.status, ended.out) == (1, "")
    assert message in ended.err


def test_held_out_rows_without_any_measurement(run: Run, cell: Path, tmp_path: Path) -> None:
    lines = (cell / "one.csv").read_text().splitlines()
    first = lines[0].split(",").index("x_mm")
    lines[50:] = [",".join([*line.split(",")[:first], "", "", ""]) for line in lines[50:]]
    (tmp_path / "lost.csv").write_text("\n".join(lines))
    result = identify(run, tmp_path / "lost.csv", tmp_path / "a.json", "--rows", "0:49", "--json").json
    assert result["held_out"] is None
    assert np.isfinite(result["fitted"]["rms_mm"])


def test_what_the_data_do_not_see_is_said(run: Run, cell: Path, tmp_path: Path) -> None:
    """The height of the base is the tracker's matter; a pose of the flange is not seen by one reflector."""
    fit = ["identify", "--robot", IRB6660, cell / "one.csv", "-o", tmp_path / "cal.json"]
    result = run(*fit, "--json").json
    seen = {p["name"]: p["seen"] for p in result["parameters"]}
    assert not seen["J1.tz"]
    assert not seen["tool.rz"]
    assert seen["J2.tx"]
    for p in result["parameters"]:
        prior = result["prior_scale"] * p[f"tolerance_{p['unit']}"]
        assert p["seen"] == (p[f"standard_error_{p['unit']}"] < 0.95 * prior)
    unseen = sum(not value for value in seen.values())
    ended = run(*fit, "--parameters")
    (table,) = re.findall("All 45 parameters.*?Digits", ended.out, re.DOTALL)
    assert table.count("prior-dominated") == unseen
    assert f"{unseen} parameters prior-dominated" in " ".join(ended.out.split())
    assert {p["seen"] for p in run(*fit, "--prior", "none", "--json").json["parameters"]} == {None}


def test_a_figure_that_was_given_is_not_said_to_be_found(run: Run, cell: Path, tmp_path: Path) -> None:
    fit = ["identify", "--robot", IRB6660, cell / "one.csv"]
    found = run(*fit, "-o", tmp_path / "found.json").out
    assert "not significant (below tracker noise)" in found
    assert "as given" not in found
    given = run(*fit, "-o", tmp_path / "given.json", "--model-error-mm", "0.05", "--prior-scale", "2").out
    assert "0.05 mm per axis (1σ), as given" in given
    assert "2 times the tolerances, as given" in given
    nothing = run(*fit, "-o", tmp_path / "nothing.json", "--keep", "none", "--prior", "none").out
    assert "residuals of geometry beyond tracker noise" in " ".join(nothing.split())  # it may break the line there


def test_wrong_rows_are_asked_for_again_and_listed(run: Run, cell: Path, tmp_path: Path) -> None:
    """Six rows of which the tracker took another reflector: these and no others, the first five by name."""
    wrong = [3, 11, 12, 38, 47, 55]
    lines = (cell / "one.csv").read_text().splitlines()
    for row in wrong:
        *others, z = lines[row + 1].split(",")
        lines[row + 1] = ",".join([*others, repr(float(z) + 8.0 + row)])
    (tmp_path / "wrong.csv").write_text("\n".join(lines) + "\n")
    ended = identify(run, tmp_path / "wrong.csv", tmp_path / "cal.json", "--json")
    assert ended.status == 0, ended.err
    result = ended.json
    assert sorted(row["row"] for row in [*result["left_out"], *result["outliers"]]) == wrong
    text = identify(run, tmp_path / "wrong.csv", tmp_path / "cal.json").out
    assert f"measure rows {', '.join(map(str, wrong[:5]))} and 1 more again" in " ".join(text.split())
    table = [words for line in text.splitlines() if len(words := line.split()) > 2]
    assert {int(words[0]) for words in table if words[0] == words[2] and words[0].isdigit()} == set(wrong)


@pytest.mark.parametrize("given", [[], ["--holdout", "0.3"], ["--folds", "4"], ["--rows", "0:12"]])
def test_rows_are_asked_to_be_held_out_where_none_are(run: Run, cell: Path, tmp_path: Path, given: list[str]) -> None:
    """Of few rows, of which a remark says that the residuals of fitted ones say little, too."""
    few = tmp_path / "few.csv"
    few.write_text("".join((cell / "one.csv").read_text().splitlines(keepends=True)[:21]))
    ended = identify(run, few, tmp_path / "cal.json", *given)
    said = " ".join((ended.out + ended.err).split())
    assert ended.status == 0, ended.err
    assert "say little" in said
    assert ("hold rows out" in said or "--holdout" in said) == (not given)


def test_next_steps_follow_from_the_errors(run: Run, cell: Path, tmp_path: Path) -> None:
    """A held-out error like the fit's asks for nothing, one of a multiple for poses; one of several times the noise for effects."""
    fitted = identify(run, cell / "one.csv", tmp_path / "cal.json", "--json").json
    calibration, mean = load_calibration(tmp_path / "cal.json"), fitted["fitted"]["mean_mm"]

    def advised(ratio: float | None, noise: float, **changed: object) -> set[str]:
        held_out = None if ratio is None else {**fitted["fitted"], "mean_mm": ratio * mean}
        steps = next_steps(calibration, {**fitted, "held_out": held_out, **changed}, noise)
        words = {
            "measure more": "poses",
            "measure in several": "turn",
            "fit non-": "effects",
        }
        return {advice for step in steps for begins, advice in words.items() if step.startswith(begins)}

    unlocated = {"tool": {**fitted["targets"]["tool"], "unlocated": "along z"}}
    assert advised(None, mean) == set()
    assert advised(1.3, mean) == set()
    assert advised(2.4, 2.0 * mean) == {"poses"}
    assert advised(1.3, 0.45 * 1.3 * mean) == {"effects"}
    assert advised(1.3, 0.55 * 1.3 * mean) == set()
    assert advised(1.3, mean, targets=unlocated) == {"turn"}
    assert advised(1.3, 0.1 * mean, explanation={}) == set()
    measured = read_campaign(cell / "one.csv", load_robot(IRB6660))
    coarse = replace(measured, q=np.radians(np.degrees(measured.q).round(1)))
    of_rows = tc.identify(calibration.model, coarse), replace(calibration, remarks=(f"{COURSE_IN_DOUBT}a drift",))
    for of_rows_alone in of_rows:  # of which no effect of the robot is the cause
        steps = next_steps(of_rows_alone, {**fitted, "held_out": fitted["fitted"]}, 0.1 * mean)
        assert not any(step.startswith("fit non-") for step in steps)
    report = next_steps(calibration, {**fitted, "calibration": "my cells/a b.json"}, mean)[-1]
    assert "my cells/a b.json" in shlex.split(report.partition(";")[0])
