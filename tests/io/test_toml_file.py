import copy
import time
import tomllib
from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Any, get_args, get_origin

import pytest
from pydantic import ValidationError

import taskcal
from taskcal.correction.cell import CellFile
from taskcal.errors import FileError
from taskcal.io.codec import schema_of
from taskcal.io.toml_file import (
    PLAIN,
    Direction,
    FileSection,
    Finite,
    HalfTurn,
    NotNegative,
    Positive,
    Quaternion,
    Sign,
    Stiffness,
    _sections,
    explain,
    read_toml,
    tables_of_task,
)
from taskcal.observations.point import Station
from taskcal.robot.robot_file import RobotFile
from taskcal.task.task import TaskFile

STATION, CELL = (schema_of(kind, brief=True) for kind in (Station, CellFile))


class Small(FileSection):
    a: float = 0.0


class Bounded(FileSection):
    finite: Finite = 0.0
    positive: Positive = 1.0
    not_negative: NotNegative = 0.0
    stiffness: Stiffness = 1.0
    half_turn: HalfTurn = 0.0
    sign: Sign = 1
    direction: Direction = (0.0, 0.0, 1.0)
    quaternion: Quaternion = (0.0, 0.0, 0.0, 1.0)


TURNED = f"{0.5**0.5!r}, 0.0, {-(0.5**0.5)!r}, 0.0"

TAKEN = {
    "finite": (["1e6", "-1e6", "0.0", "-3"], ["1.01e6", "-1.01e6", "nan", "true", '"1"']),
    "positive": (["1e-6", "1e6"], ["0.0", "0.5e-6", "-1.0", "inf", "2e6"]),
    "not_negative": (["0.0", "1e6"], ["-1e-9", "2e6"]),
    "stiffness": (["1e15"], ["0.0", "2e15"]),
    "half_turn": (["0.0", "180.0"], ["-0.1", "180.1"]),
    "sign": (["1", "-1"], ["0", "2", "1.0", "true", '"1"']),
    "direction": (["[0.0, 1e-6, 0.0]", "[3, -4.0, 0]"], ["[0.5e-6, 0.0, 0.0]", "[0.0, 0.0, 0.0]", "[1.0, 0.0]"]),
    "quaternion": (
        [f"[{TURNED}]", "[0.0, 0.0, 0.0, -1.009]", "[0.991, 0.0, 0.0, 0.0]"],
        ["[0.0, 0.0, 0.0, 1.02]", "[0.98, 0, 0, 0]"],
    ),
}
"""As the reference of task files has them: up to 1e6, above zero from 1e-6, stiffness up to 1e15."""


@pytest.mark.parametrize("key", TAKEN)
def test_numbers_are_taken_up_to_their_bounds(tmp_path, key):
    path = tmp_path / "file.toml"
    taken, refused = TAKEN[key]
    for value in taken:
        path.write_text(f"{key} = {value}")
        assert getattr(read_toml(path, Bounded), key) == pytest.approx(tomllib.loads(f"x = {value}")["x"], rel=1e-15)
    for value in refused:
        path.write_text(f"{key} = {value}")
        with pytest.raises(FileError, match=key):
            read_toml(path, Bounded)


HOSTILE = {
    "nested arrays": ("a = " + "[" * 500 + "]" * 500, "its brackets are nested too deeply"),
    "nested tables": ("a = " + "{a = " * 500 + "1" + "}" * 500, "its brackets are nested too deeply"),
    "a key of 100 000 parts": (".".join("a" * 100_000) + " = 1", "a key has more than 20 parts"),
    "a header of 100 000 parts": ("[" + ".".join("a" * 100_000) + "]", "a key has more than 20 parts"),
    "a key in braces": ("a = {" + ".".join("a" * 1000) + " = 1}", "a key has more than 20 parts"),
    "a key in quotes": (".".join(["'a'"] * 1000) + " = 1", "a key has more than 20 parts"),
    "an integer of 5000 digits": ("a = " + "9" * 5000, "is not TOML: a number has too many digits"),
    "cut off": ("a = [1,", "is not TOML: "),
    "a date that is none": ("a = 2020-13-45", "is not TOML: "),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_files_are_refused_at_once(tmp_path, kind):
    text, message = HOSTILE[kind]
    path = tmp_path / "file.toml"
    path.write_text(text, encoding="utf-8")
    began = time.perf_counter()
    with pytest.raises(FileError, match=rf"file\.toml(:\d+)?: .*{message}"):
        read_toml(path, Small)
    assert tables_of_task(path) == []
    assert time.perf_counter() - began < 2.0


def test_what_users_write_reaches_the_parser_in_one_place():
    """Elsewhere no bound would hold; the studio's own texts are none of theirs."""
    sources = Path(taskcal.__file__).parents[1]
    found = {
        path.relative_to(sources).as_posix() for path in sources.rglob("*.py") if "tomllib.load" in path.read_text()
    }
    assert found == {"taskcal/io/toml_file.py", "taskcal_studio/texts.py"}


def test_dots_in_values_and_comments_are_no_long_key(tmp_path):
    path = tmp_path / "file.toml"
    path.write_text(f"# {'.' * 60}\nposes = '{'.' * 60}csv'  # {'.' * 60}\n", encoding="utf-8")
    assert tables_of_task(path) == [f"{'.' * 60}csv"]


def test_many_decimal_numbers_in_a_line_are_no_long_key(tmp_path):
    path = tmp_path / "file.toml"
    path.write_text("a = [" + ", ".join(["1.5"] * 3000) + "]", encoding="utf-8")
    with pytest.raises(FileError, match="a: "):
        read_toml(path, Small)


@pytest.mark.parametrize(
    ("schema", "text", "said"),
    [
        (TaskFile, 'name = "t"\n[box]\nsize_mm = [1, 1, 1]', "'box' is not a known key; known: name, workspace, "),
        (
            TaskFile,
            'name = "t"\n[workspace]\nsizes_mm = 1.0',
            "workspace: 'sizes_mm' is not a known key; did you mean 'size_mm'",
        ),
        (
            TaskFile,
            'name = "t"\n[workspace]\ncone_deg = 20.0',
            "workspace: 'cone_deg' is not a known key; it belongs in [[workspace.orientation]]; workspace, ",
        ),
        (TaskFile, 'poses = "p.csv"\n[frames.a]\nspin = "free"\n', "it belongs in [[workspace.orientation]]"),
        (
            TaskFile,
            '[workspace]\nname = "t"\n',
            "workspace: 'name' is not a known key; it belongs in the first lines; ",
        ),
        (
            STATION,
            'position_mm = [0, 0, 9]\n[[reflector]]\nname = "a"\nposition_mm = [0, 0, 0]\nqq = 1',
            "reflector 1: 'qq' is not a known key; known: name, position_mm, ",
        ),
        (
            CELL,
            "[[axis]]\nturn_about = [0, 0, 1]",
            "axis 1: 'turn_about' is not a known key; did you mean 'turns_about'",
        ),
    ],
)
def test_unknown_key_message_lists_valid_keys(tmp_path, schema, text, said):
    """The message for an unknown key lists the valid keys."""
    path = tmp_path / "file.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError) as refusal:
        read_toml(path, schema)
    assert said in str(refusal.value)


SOUND = {
    RobotFile: """
        name = "arm"
        title = "Arm"
        source = ["a data sheet"]
        gravity = [0.0, 0.0, -1.0]
        link_radii_mm = [50.0, 50.0, 50.0]
        tool = [{ tx_mm = 100.0, symbol = "t" }]
        flange = [{ rz_deg = 10.0 }]
        coupled_limit = [{ of = "J2 + J1", range_deg = [-60.0, 60.0] }]
        joint = [
            { name = "J1", dh = { alpha_deg = 90.0, a_mm = 600.0, d_mm = 1.0 }, limits_deg = [-90.0, 90.0], mass_kg = 1.0, centre_mm = [0.0, 0.0, 1.0], stiffness_nm_rad = 1e6, gear_ratio = 100.0, speed_deg_s = 90.0, acceleration_deg_s2 = 90.0, angle = "J1", offset_deg = 1.0 },
            { name = "J2", type = "prismatic", steps = [{ ty_mm = 1.0 }], limits_mm = [0.0, 9.0], mass_kg = 1.0, centre_mm = [0.0, 0.0, 1.0], stiffness_n_mm = 1e6, speed_mm_s = 90.0, acceleration_mm_s2 = 9.0, offset_mm = 1.0 },
        ]
        four_bar = { drives = "J2", arm = "J1", crank = "J2", crank_mm = 400.0, rod_mm = 600.0, rocker_mm = 400.0, arm_mm = 600.0, crank_angle_deg = -90.0, rocker_angle_deg = -90.0, assembly = 1 }
        payload = { mass_kg = 5.0, centre_mm = [0.0, 0.0, 1.0] }
        spring = { joint = "J1", rate_n_mm = 60.0, free_length_mm = 300.0, crank_mm = 200.0, anchor_mm = 500.0, aligned_deg = 20.0 }
        tolerance = { translation_mm = 1.0, rotation_mrad = 1.0, length_mm = 1.0, parameter_mm = { "J1.tx" = 1.0 }, parameter_mrad = { "J1.rx" = 1.0 } }
        symbols = { tx = "t{}x" }
        published = { source = "a paper", redundant = ["J1.tx"], zero = [], dropped = [] }
    """,  # noqa: E501
    TaskFile: """
        name = "milling"
        workspace = { frame = "part", shape = "box", center_mm = [1.0, 2.0, 3.0], size_mm = [1.0, 2.0, 3.0], orientation = [{ quaternion = [0.0, 0.0, 0.0, 1.0], cone_deg = 20.0, spin = "fixed", spin_deg = 3.0 }] }
        frames = { part = { position_mm = [1.0, 2.0, 3.0], quaternion = [0.0, 0.0, 0.0, 1.0] } }
        accuracy = { position_mm = 0.1 }
    """,  # noqa: E501
    STATION: """
        position_mm = [4000.0, 0.0, 1000.0]
        reach_m = 30.0
        nearest_m = 0.5
        reflector = [{ name = "A", position_mm = [0.0, 0.0, 50.0], axis = [0.0, 0.0, 1.0], acceptance_deg = 30.0 }]
        keep_out = [{ center_mm = [0.0, 0.0, 50.0], size_mm = [1.0, 1.0, 1.0], quaternion = [0.0, 0.0, 0.0, 1.0] }]
    """,
    CELL: """
        tool = [{ name = "spindle", controller = { position_mm = [0.0, 0.0, 9.0] }, reflectors_mm = { A = [0.0, 0.0, 1.0], B = [0.0, 1.0, 1.0], C = [1.0, 0.0, 1.0] }, uncertainty_mm = 0.1 }]
        part = [{ name = "table", touched_with = "spindle", touched_deg = [[1.0, 2.0], [1.0, 2.0], [1.0, 2.0]] }]
    """,  # noqa: E501
}  # fmt: skip

STRANGE: tuple[Any, ...] = (
    *(True, "", "600", "ä", 0, -1, 7, 1e308, -1e308, 1e-320, float("nan"), float("inf"), 10**400),
    *([], [1], ["x"] * 9, {}, {"x": 1}, date(2020, 1, 1), None),
)


def places(content, place=()):
    """Every place of a content but its root."""
    entries = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, inner in entries:
        yield (*place, key)
        yield from places(inner, (*place, key))


def put(content, place, value):
    """The content with another value at a place."""
    changed = copy.deepcopy(content)
    inner = changed
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    return changed


@pytest.mark.parametrize("schema", SOUND)
def test_every_error_of_a_schema_is_in_plain_words(schema):
    sound = tomllib.loads(SOUND[schema])
    schema.model_validate(sound)
    met = set()
    for place in places(sound):
        for value in STRANGE:
            try:
                schema.model_validate(put(sound, place, value))
            except ValidationError as error:
                message = explain(error, schema)
                met |= {item["type"] for item in error.errors(include_input=False)}
                assert "should" not in message, message
                assert "alid" not in message, message
                assert len(message) < 1500
    assert "float_type" in met
    assert met <= {*PLAIN, "extra_forbidden"}


def number_places(content, place=()):
    return [p for p in places(content) if isinstance(at(content, p), float)]


def at(content, place):
    for key in place:
        content = content[key]
    return content


@pytest.mark.parametrize("schema", SOUND)
@pytest.mark.parametrize("value", [True, "600", 1e308, -1e308, float("nan"), 10**400], ids=lambda v: repr(v)[:6])
def test_numbers_of_wrong_type_or_range_are_rejected(schema, value):
    """A number of another type or out of all bounds is rejected in every file."""
    sound = tomllib.loads(SOUND[schema])
    for place in number_places(sound):
        with pytest.raises(ValidationError) as caught:
            schema.model_validate(put(sound, place, value))
        names = [str(key) for key in place if isinstance(key, str)]
        assert names[-1] in explain(caught.value, schema)


def test_a_size_that_vanishes_when_squared_is_refused():
    sound = tomllib.loads(SOUND[TaskFile])
    with pytest.raises(ValidationError) as caught:
        TaskFile.model_validate(put(sound, ("workspace", "size_mm", 0), 1e-320))
    assert "workspace, size_mm 1: must be 1e-06 or more (got 1e-320)" in explain(caught.value, TaskFile)
    with pytest.raises(ValidationError) as caught:
        TaskFile.model_validate(put(sound, ("workspace", "axis"), [0.0, 1e-200, 0.0]))
    assert "workspace, axis: has no direction" in explain(caught.value, TaskFile)


@pytest.mark.parametrize("value", [7, {"colour": "red"}, {"cone_deg": 500.0}])
def test_a_wrong_entry_is_not_said_to_be_lacking_as_well(value):
    sound = tomllib.loads(SOUND[TaskFile])
    with pytest.raises(ValidationError) as caught:
        TaskFile.model_validate(put(sound, ("workspace", "orientation", 0), value))
    assert "workspace, orientation 1" in explain(caught.value, TaskFile)
    assert "entries" not in explain(caught.value, TaskFile)
    with pytest.raises(ValidationError) as caught:
        TaskFile.model_validate(put(sound, ("workspace", "orientation"), []))
    assert explain(caught.value, TaskFile) == "workspace, orientation: has no entries; give 1 or more"


def headers(schema: type[FileSection], within: tuple[str, ...] = ()) -> list[tuple[tuple[str, ...], bool]]:
    """Places of the sections of a schema that stand under no list, and whether each is one of a list."""
    out: list[tuple[tuple[str, ...], bool]] = []
    for name, field in schema.model_fields.items():
        kinds = {get_origin(kind) for kind in (field.annotation, *get_args(field.annotation))}
        sections = _sections(field.annotation)
        if not sections or kinds & {dict, Mapping}:
            continue
        listed = bool(kinds & {tuple, list})
        out.append(((*within, name), listed))
        if not listed and len(sections) == 1:
            out += headers(next(iter(sections)), (*within, name))
    return out


HEADERS = [(schema, *one) for schema in (CELL, STATION, RobotFile, TaskFile) for one in headers(schema)]


@pytest.mark.parametrize(("schema", "place", "listed"), HEADERS, ids=lambda one: getattr(one, "__name__", None))
def test_wrong_brackets_of_a_header_are_answered_by_right_ones(tmp_path, schema, place, listed):
    key, path = ".".join(place), tmp_path / "file.toml"
    wrong, right = (f"[{key}]", f"[[{key}]]") if listed else (f"[[{key}]]", f"[{key}]")
    path.write_text(f"{wrong}\n", encoding="utf-8")
    with pytest.raises(FileError, match="is one table" if listed else "is a list of tables") as refusal:
        read_toml(path, schema)
    assert f"{', '.join(place)}: " in str(refusal.value)
    assert f" {right}" in str(refusal.value)
