"""Options: groups of them, what is checked of their values, and what commands get of them."""

import re
import shlex
from dataclasses import dataclass
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from typer.main import get_command
from typer.testing import CliRunner

from taskcal.cli import app, main
from taskcal.cli.command import argument, in_users_words, laid_out, option, what_writes
from taskcal.cli.options.campaign import CampaignOptions, MeasuredOptions, choose_rows
from taskcal.cli.options.common import ModelOptions
from taskcal.cli.options.fit import fit_options
from taskcal.errors import FileError, TaskcalError
from taskcal.identification.options import (
    EffectSearch,
    FitOptions,
    GeometryOptions,
    check_together,
    read_effects,
)
from taskcal.reading.options import UsedRows
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import (
    PERIODIC,
    Compliance,
    Coupling,
    EncoderGain,
    Harmonics,
    MotorHarmonics,
    Spring,
    Thermal,
    WarmUp,
)
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from taskcal_groundwork.options import OptionError, Written, options_of, read
from tests.cli.conftest import IRB6660, TASK, Run


@dataclass(frozen=True, kw_only=True)
class Size:
    width_mm: float = option(..., "MM", also="-w")
    height: float = option(2.0, named="height-mm")

    def __post_init__(self) -> None:
        if self.width_mm < self.height:
            raise typer.BadParameter("it is higher than wide", param_hint="--height-mm")


def ran(*arguments: str) -> tuple[int, list[Any], str]:
    """Exit status, what the command got, and what was printed."""
    got: list[Any] = []

    @laid_out
    def command(*, name: str = argument(..., "NAME", "What is drawn."), size: Size, twice: bool = False) -> None:
        """Draw."""
        got.extend((name, size, twice))

    only = typer.Typer()
    only.command()(command)
    result = CliRunner().invoke(only, arguments, env={"TYPER_USE_RICH": "0", "COLUMNS": "200"})
    return result.exit_code, got, result.output


def test_group_reaches_the_command_as_one_value() -> None:
    assert ran("box", "--height-mm", "1", "--width-mm", "3", "--twice")[:2] == (
        0,
        ["box", Size(width_mm=3, height=1), True],
    )


def test_group_defaults_are_those_of_its_fields() -> None:
    assert ran("box", "-w", "3")[:2] == (0, ["box", Size(width_mm=3), False])


def test_option_without_default_is_required() -> None:
    status, _, text = ran("box")
    assert status == 2
    assert "--width-mm" in text


def test_group_refusal_is_wrong_usage() -> None:
    status, got, text = ran("box", "--width-mm", "1")
    assert (status, got) == (2, [])
    assert "it is higher than wide" in text


def test_group_options_keep_their_place() -> None:
    @laid_out
    def command(first: int, size: Size, last: int) -> None: ...

    assert list(signature(command).parameters) == ["first", "width_mm", "height_mm", "last"]


def test_two_options_of_one_name_are_refused() -> None:
    def command(width_mm: int, size: Size) -> None: ...

    with pytest.raises(ValueError, match="width_mm"):
        laid_out(command)


def commands() -> dict[str, Any]:
    group: Any = get_command(app)
    return dict(group.commands)


@pytest.mark.parametrize("name", ["identify", "register", "validate", "select", "sensitivity", "plan", "report"])
def test_commands_share_the_options_of_a_campaign(name: str) -> None:
    from taskcal.cli.options.campaign import CampaignOptions

    parameters = {parameter.name: parameter.opts for parameter in commands()[name].params}
    for one in options_of(CampaignOptions):
        assert parameters[one.field] == [f"--{one.name}", *filter(None, [one.option.also])]


def test_no_command_takes_a_number_of_no_things(run: Run) -> None:
    """Nor parts of which one is held out by itself; a seed and a port may be zero."""
    too_few = {"N": "0", "K": "1"}
    counted = [
        (name, one.opts[0], too_few[one.metavar])
        for name, command in commands().items()
        for one in command.params
        if one.metavar in too_few and not {"--seed", "--port"}.intersection(one.opts)
    ]
    assert len(counted) > 15
    for name, counting, number in counted:
        ended = run(name, counting, number)
        assert ended.status == 2, (name, counting)
        assert counting in ended.err
        assert "Missing" not in ended.err


def test_command_of_the_report_reads_the_campaign_alike() -> None:
    """Names with spaces are quoted, and what was not given is not there."""
    given = CampaignOptions(board=Path("b.toml"), images=Path("my shots"), rows="0:20", camera_exact=True)
    words = shlex.split(given.named_images([Path("a.csv")]))
    assert words[:2] == ["--campaign", "a.csv"]
    assert sorted(words[2:]) == sorted(
        ["--board", "b.toml", "--rows", "0:20", "--camera-exact", "--images", "my shots"]
    )
    assert CampaignOptions(rows="0:20").named_images([Path("a.csv")]) == ""


def test_option_names_have_their_unit() -> None:
    units = {"MM": "-mm", "DEG": "-deg", "S": "-s", "MM/S": "-mm-s"}
    named = [
        (name, parameter.metavar)
        for command in commands().values()
        for parameter in command.params
        for name in parameter.opts
        if parameter.metavar in units
    ]
    assert len(named) > 10
    for name, metavar in named:
        assert name.endswith(units[metavar])


@pytest.mark.parametrize("command", ["robots show {}", "poses -r {} angles.csv", "robots import {} -o robot.toml"])
def test_xacro_reads_outside_its_folder_with_trust_alone(command, tmp_path, monkeypatch, capsys) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "length.yaml").write_text("0.5", encoding="utf-8")
    xacro = tmp_path / "own" / "arm.xacro"
    xacro.write_text(
        """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="base"/><link name="tool0"/>
        <joint name="j1" type="continuous"><origin xyz="0 0 ${load_yaml('../length.yaml')}"/>
        <parent link="base"/><child link="tool0"/><axis xyz="0 0 1"/></joint></robot>""",
        encoding="utf-8",
    )
    (tmp_path / "angles.csv").write_text("id,j1_deg\n0,0\n1,90\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    arguments = command.format(xacro).split()
    assert main(arguments) == 1
    assert "length.yaml', which lies outside the file's own folder" in " ".join(capsys.readouterr().err.split())
    assert main([*arguments, "--trust-xacro"]) == 0


def test_every_command_with_a_robot_takes_trust() -> None:
    groups = commands()
    every = {**groups, **{f"robots {name}": inner for name, inner in groups["robots"].commands.items()}}
    takes = {
        name: {option for parameter in command.params for option in parameter.opts} for name, command in every.items()
    }
    assert {name for name, options in takes.items() if "--trust-xacro" in options} == {
        "robots import",
        "robots show",
        "robots task",
        *(name for name, options in takes.items() if "--robot" in options),
    }


@pytest.mark.parametrize(
    ("option", "words"),
    [
        (["--count", "many"], "'many' is not a whole number; write for example 10"),
        (["--count=0"], "'0' must be 1 or more"),
        (["--seed", "1", "--seed", "x"], "'x' is not a whole number"),
        (["--model-error-mm", "thin"], "'thin' is not a number; write for example 0.5"),
        (["--criterion", "X"], "'X' is not one of 'task'"),
    ],
)
def test_message_has_the_value_and_what_to_write(run: Run, tmp_path: Path, option: list[str], words: str) -> None:
    (tmp_path / "task.toml").write_text(TASK)
    ended = run("plan", "--robot", "abb-irb120", "--task", tmp_path / "task.toml", "-o", tmp_path / "plan.csv", *option)
    assert (ended.status, ended.out) == (2, "")
    assert words in " ".join(ended.err.replace("│", " ").split())


def test_messages_of_the_parser_alone_are_put_in_words() -> None:
    assert in_users_words("there is no such way", ["--observe"], ["--observe", "x"]) == "there is no such way"
    assert in_users_words("Input should be less than 3", ["CAMPAIGN"], ["plan"]) == "must be below 3"


@pytest.mark.parametrize("command", ["identify", "plan", "validate"])
def test_help_lists_effects_where_the_command_takes_them(run: Run, command: str) -> None:
    listed = run(command, "--help").out.partition("Effects:")[2]
    assert ("compliance" in listed) == (command != "validate")


def test_effects_are_read_by_name() -> None:
    assert read_effects("auto") is None
    assert read_effects("none") == ()
    named = read_effects("compliance, gain,harmonics,harmonics:3,harmonics:5-7,periodic")
    orders = Harmonics(orders=(3,)), Harmonics(orders=(5, 6, 7))
    assert named == (Compliance(), EncoderGain(), Harmonics(), *orders, PERIODIC)
    assert read_effects("thermal,warmup,warmup:20") == (Thermal(), WarmUp(), WarmUp(time_constant=1200.0))
    assert read_effects("coupling,spring,motor") == (Coupling(), Spring(), MotorHarmonics())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("friction", "'friction' is not an effect; known: backlash, compliance, coupling, field, gain"),
        ("auto,gain", "'auto' cannot be combined"),
        ("gain,gain", "'gain' is listed twice"),
        ("harmonics:3-1", "write harmonics:1-4"),
        ("harmonics:0", "write harmonics:1-4"),
        ("warmup:0", "'warmup:0' is not an effect"),
    ],
)
def test_wrong_effects_are_refused(text: str, words: str) -> None:
    with pytest.raises(OptionError, match=words):
        read_effects(text)


# A model, by robot or calibration.


def test_model_is_of_a_robot_with_effects_or_of_a_calibration(cell: Path) -> None:
    model, calibration = ModelOptions(robot=IRB6660, effects="compliance,gain").load()
    assert ([effect.key for effect in model.effects], calibration) == (["compliance", "gain"], None)
    model, calibration = ModelOptions(calibration=cell / "cal.json").load()
    assert calibration is not None
    assert model is calibration.model


@pytest.mark.parametrize(
    ("options", "hint"),
    [
        ({}, "--robot / --calibration"),
        ({"robot": IRB6660, "calibration": Path("cal.json")}, "--robot / --calibration"),
        ({"calibration": Path("cal.json"), "effects": "gain"}, "--effects / --calibration"),
    ],
    ids=["neither", "both", "effects of a calibration"],
)
def test_model_has_exactly_one_source(options: dict[str, Any], hint: str) -> None:
    with pytest.raises(typer.BadParameter) as refused:
        ModelOptions(**options)
    assert refused.value.param_hint == hint


def test_effects_are_not_selected_without_measurements() -> None:
    with pytest.raises(typer.BadParameter, match="list the effects"):
        ModelOptions(robot=IRB6660, effects="auto").load()


# A campaign and its rows.


def test_campaign_is_read_whole_by_default(cell: Path) -> None:
    read = CampaignOptions().read(cell / "three.csv", load_robot(IRB6660))
    assert read.rows == tuple(range(30))
    assert read.campaign is read.whole
    assert (read.campaign.targets, read.drift) == (("smr1", "smr2", "smr3"), None)


def test_rows_and_targets_are_chosen(cell: Path) -> None:
    robot = load_robot(IRB6660)
    read = CampaignOptions(rows="3:8", targets=("smr3", "smr1")).read(cell / "three.csv", robot, targets=["smr2"])
    assert set(read.campaign.targets) == {"smr1", "smr3"}
    np.testing.assert_array_equal(read.campaign.q, read.whole.q[3:8])
    assert [read.campaign.row_of(i) for i in range(5)] == list(read.rows) == [3, 4, 5, 6, 7]
    assert CampaignOptions().read(cell / "three.csv", robot, targets=["smr2"]).campaign.targets == ("smr2",)


@pytest.mark.parametrize(("field", "option"), [("targets", "targets"), ("reference_points", "reference-points")])
@pytest.mark.parametrize("text", ["a,,b", "a,a", " "])
def test_wrong_list_is_refused_before_reading(field: str, option: str, text: str) -> None:
    with pytest.raises(OptionError) as refused:
        read(UsedRows, {option: text})
    assert refused.value.names == (field,)


def test_missing_reference_points_are_named(cell: Path) -> None:
    with pytest.raises(TaskcalError, match="wall"):
        CampaignOptions(reference_points=("wall",)).read(cell / "three.csv", load_robot(IRB6660))


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"rows": "0:9"}, "--rows"),
        ({"targets": ("a",)}, "--targets"),
        ({"reference_points": ("a",)}, "--reference-points"),
        ({"drift": "ignore"}, "--drift"),
    ],
)
def test_options_of_a_campaign_require_one(options: dict[str, Any], named: str) -> None:
    with pytest.raises(OptionError, match="requires --campaign") as refused:
        MeasuredOptions(**options)
    assert refused.value.names == (named.strip("-").replace("-", "_"),)
    assert MeasuredOptions(campaign=Path("c.csv"), **options).campaign == Path("c.csv")


def test_endless_row_number_is_refused_and_shortened(tmp_path: Path) -> None:
    path = tmp_path / "rows.txt"
    path.write_text("1\n" + "9" * 5000 + "\n")
    with pytest.raises(FileError, match=r"rows\.txt:2: '9+…9+ \(5000 characters\)' is not a row number"):
        choose_rows(str(path), 50, Path("campaign.csv"))


@pytest.mark.parametrize("text", ["1:" + "9" * 200, "١:٣"], ids=["endless", "other digits"])
def test_range_of_other_characters_is_refused(text: str) -> None:
    with pytest.raises(typer.BadParameter, match="is not a range of rows"):
        choose_rows(text, 50, Path("campaign.csv"))


# A fit.


@pytest.fixture(scope="module")
def model() -> ErrorModel:
    return ErrorModel(load_robot(IRB6660))


@pytest.fixture(scope="module")
def campaign(model: ErrorModel):
    rng = np.random.default_rng(0)
    return simulate(model, rng.uniform(-0.5, 0.5, (5, 6)), rng=rng)[0]


def made(model: ErrorModel, campaign: Any, **texts: str) -> FitOptions:
    """Options of a fit by what is written of them."""
    written = read(FitOptions, {name.replace("_", "-"): text for name, text in texts.items()})
    return fit_options(written, model, campaign)[0]


def test_fit_options_default_to_those_of_the_library(model, campaign) -> None:
    assert vars(made(model, campaign)) == vars(FitOptions())


def test_what_stands_for_a_default_is_read_as_it(model, campaign) -> None:
    """As help shows it."""
    begun = {one.name: one.written(one.default) for one in options_of(FitOptions)}
    texts = {name: str(text) for name, text in begun.items() if text is not None}
    assert texts["target-within-mm"] == "1000.0"
    assert vars(made(model, campaign, **texts)) == vars(FitOptions())


def test_fit_options_are_converted_to_metres(model, campaign) -> None:
    options = made(
        model,
        campaign,
        keep="J2,J3",
        prior="none",
        frames="fixed",
        model_error_mm="0.05",
        gross_errors="keep",
        target_within_mm="1500",
        mpe_to_sigma="0.577",
    )
    assert (options.keep, options.prior, options.frames, options.gross_errors) == (("J2", "J3"), None, "fixed", "keep")
    assert options.model_error == pytest.approx(50e-6)
    assert options.target_within == pytest.approx(1.5)
    assert options.noise is not None
    assert options.noise.mpe_to_sigma == pytest.approx(0.577)


def test_published_and_none_are_sets_of_parameters(model, campaign) -> None:
    assert made(model, campaign, keep="none").keep == ()
    published = made(model, campaign, keep="published").keep
    assert published is not None
    assert set(published) == set(model.names) - set(model.robot.published.dropped)
    with pytest.raises(TaskcalError, match="names no publication"):
        made(ErrorModel(load_robot("ur10")), campaign, keep="published")


@pytest.mark.parametrize(
    ("texts", "names"),
    [
        ({"prior": "none", "prior-scale": "2"}, ("prior_scale", "prior")),
        ({"prior": "none", "like": "cal.json"}, ("like", "prior")),
        ({"keep": "J1,J1"}, ("keep",)),
        ({"frames": "free"}, ("frames",)),
        ({"prior-scale": "nan"}, ("prior_scale",)),
        ({"prior-scale": "much"}, ("prior_scale",)),
    ],
)
def test_contradictory_fit_options_are_refused(texts, names) -> None:
    with pytest.raises(OptionError) as refused:
        read(FitOptions, texts)
    assert refused.value.names == names


def test_groups_are_checked_against_one_another() -> None:
    none, fitting = GeometryOptions(), Written(FitOptions)
    check_together(Written(EffectSearch), none, fitting)
    with pytest.raises(OptionError, match="effects / prior: 'auto' weighs"):
        check_together(Written(EffectSearch), none, read(FitOptions, {"prior": "none"}))
    with pytest.raises(OptionError, match="lengths_only / keep: keep published selects"):
        check_together(
            Written(EffectSearch), GeometryOptions(lengths_only=True), read(FitOptions, {"keep": "published"})
        )


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--model-error-mm", "-1", "'-1' must be 0 or more"),
        ("--model-error-mm", "nan", "'nan' is not a number"),
        ("--prior-scale", "0", "'0' must be 0.000001 or more"),
        ("--mpe-to-sigma", "0", "'0' must be 0.001 or more"),
        ("--holdout", "1", "1 is not between 0 and 1"),
        ("--holdout", "nan", "nan is not between 0 and 1"),
    ],
)
def test_numbers_out_of_their_bounds_are_wrong_usage(option: str, value: str, words: str, tmp_path, capsys) -> None:
    (tmp_path / "campaign.csv").touch()
    arguments = ["identify", str(tmp_path / "campaign.csv"), "-r", "ur5", "-o", str(tmp_path / "cal.json")]
    assert main([*arguments, option, value]) == 2
    said = capsys.readouterr().err
    assert option in said
    assert words in said


def every_command() -> dict[str, Any]:
    """Commands by their words, those of a group one by one."""
    out: dict[str, Any] = {}
    for name, command in commands().items():
        inner = getattr(command, "commands", None)
        out |= {name: command} if inner is None else {f"{name} {word}": one for word, one in inner.items()}
    return out


def kinds_of(parameter: Any) -> set[str]:
    """Files that the help of an option or argument shows, without their endings: ``CAL`` of ``CAL.json CAL.json…``."""
    words = {word.partition(".")[0] for word in re.findall(r"[\w.]+", parameter.metavar or "")}
    return words - {"FILE", "FOLDER", "OUT"}  # these say nothing of what is in it


@pytest.mark.parametrize("name", list(every_command()))
def test_what_is_missing_names_the_commands_that_write_it(name: str, run: Run) -> None:
    """Of all that any command needs: what writes it is every command that has an output of its kind."""
    every = every_command()
    for missing in every[name].params:
        if missing.required and "--output" not in missing.opts:
            writers = {
                words
                for words, command in every.items()
                if any("--output" in one.opts and kinds_of(one) & kinds_of(missing) for one in command.params)
            }
            quoted = re.findall(r"'(taskcal [^']+)'", what_writes(missing, get_command(app)))
            assert all(any(use.startswith(f"taskcal {words} ") for use in quoted) for words in writers)
            assert bool(quoted) == bool(writers)
    first = next((one for one in every[name].params if one.required), None)
    if first is not None:
        ended = run(*name.split())
        needed = [one for one in every[name].params if one.required and one.opts[0] in ended.err]
        said = what_writes(first if first.param_type_name == "argument" else needed[0], get_command(app))
        assert ended.status == 2
        assert ended.err.rstrip().endswith(said or ".")
