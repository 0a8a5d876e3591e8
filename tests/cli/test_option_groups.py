"""Groups of options, laid out for the command line and put together again."""

from dataclasses import dataclass, fields
from inspect import signature
from typing import Annotated, Any

import pytest
import typer
from typer.main import get_command
from typer.testing import CliRunner

from taskcal.cli import app, main
from taskcal.cli.command import laid_out


@dataclass(frozen=True, kw_only=True)
class Size:
    width: Annotated[float, typer.Option("--width-mm")]
    height: Annotated[float, typer.Option("--height-mm")] = 2.0

    def __post_init__(self) -> None:
        if self.width < self.height:
            raise typer.BadParameter("it is higher than wide", param_hint="--height-mm")


def ran(*arguments: str) -> tuple[int, list[Any], str]:
    """Exit status, what the command got, and what was printed."""
    got: list[Any] = []

    @laid_out
    def command(name: Annotated[str, typer.Argument()], size: Size, twice: bool = False) -> None:
        """Draw."""
        got.extend((name, size, twice))

    only = typer.Typer()
    only.command()(command)
    result = CliRunner().invoke(only, arguments, env={"TYPER_USE_RICH": "0", "COLUMNS": "200"})
    return result.exit_code, got, result.output


def test_a_command_gets_the_group_as_one_value() -> None:
    assert ran("box", "--height-mm", "1", "--width-mm", "3", "--twice")[:2] == (
        0,
        ["box", Size(width=3, height=1), True],
    )


def test_defaults_are_those_of_the_fields() -> None:
    assert ran("box", "--width-mm", "3")[:2] == (0, ["box", Size(width=3), False])


def test_what_has_no_default_must_be_given() -> None:
    status, _, text = ran("box")
    assert status == 2
    assert "--width-mm" in text


def test_what_a_group_refuses_is_wrong_usage() -> None:
    status, got, text = ran("box", "--width-mm", "1")
    assert (status, got) == (2, [])
    assert "it is higher than wide" in text


def test_options_stand_where_the_group_does() -> None:
    @laid_out
    def command(first: int, size: Size, last: int) -> None: ...

    assert list(signature(command).parameters) == ["first", "width", "height", "last"]


def test_two_options_of_one_name_are_refused() -> None:
    def command(width: int, size: Size) -> None: ...

    with pytest.raises(ValueError, match="width"):
        laid_out(command)


def commands() -> dict[str, Any]:
    group: Any = get_command(app)
    return dict(group.commands)


@pytest.mark.parametrize("name", ["identify", "register", "validate", "select", "sensitivity", "plan", "report"])
def test_every_command_that_reads_a_campaign_has_the_same_options_of_it(name: str) -> None:
    from taskcal.cli.options.campaign import CampaignOptions

    parameters = {parameter.name: parameter.opts for parameter in commands()[name].params}
    for option in fields(CampaignOptions):
        second = ["--nests"] if option.name == "reference_points" else []
        assert parameters[option.name] == [f"--{option.name.replace('_', '-')}", *second]


def test_a_length_an_angle_or_a_time_has_its_unit_in_the_name() -> None:
    units = {"MM": "-mm", "DEG": "-deg", "S": "-s", "MM/S": "-mm-s"}
    named = [
        (option, parameter.metavar)
        for command in commands().values()
        for parameter in command.params
        for option in parameter.opts
        if parameter.metavar in units
    ]
    assert len(named) > 10
    for option, metavar in named:
        assert option.endswith(units[metavar])


@pytest.mark.parametrize("command", ["robots show {}", "poses -r {} angles.csv", "robots import {} -o robot.toml"])
def test_a_xacro_file_is_a_program_with_trust_alone(command, tmp_path, monkeypatch, capsys) -> None:
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


def test_every_command_that_takes_a_robot_takes_trust() -> None:
    groups = commands()
    every = {**groups, **{f"robots {name}": inner for name, inner in groups["robots"].commands.items()}}
    takes = {
        name: {option for parameter in command.params for option in parameter.opts} for name, command in every.items()
    }
    assert {name for name, options in takes.items() if "--trust-xacro" in options} == {
        "robots import",
        "robots show",
        *(name for name, options in takes.items() if "--robot" in options),
    }
