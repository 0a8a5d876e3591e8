"""The JSON of every command, which programs read: no key goes, none comes unseen, and people are shown the same numbers."""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskcal.cli.output import plain, with_edits
from taskcal.cli.run import OutputOptions
from tests.cli.conftest import IRB6660, Run

KEYS = tomllib.loads((Path(__file__).parent / "json_keys.toml").read_text(encoding="utf-8"))
"""By command: the keys of the result, and of the entries of its lists."""

TASK = "list.toml"
COMMANDS = {
    "robots": "robots",
    "robots show": "robots show ROBOT",
    "robots import": "robots import table.csv --convention dh -o robot.toml",
    "robots task": "robots task ROBOT -o begun.toml",
    "simulate": "simulate --robot ROBOT --task TASK --count 20 -o again.csv",
    "sensitivity": "sensitivity --robot ROBOT --task TASK",
    "select": "select --robot ROBOT --task TASK",
    "plan": "plan --robot ROBOT --task TASK --count 8 --candidates 60 -o plan.csv",
    "study": "study --robot ROBOT --task TASK --robots 1 --counts 8 --plans random --engine sequential",
    "board": "board --kind circles --columns 5 --rows 7 --square-mm 20 --marker-mm 9 -o sheet.pdf",
    "convert": "convert one.csv --robot ROBOT -o plain.csv",
    "register": "register --robot ROBOT one.csv",
    "identify": "identify --robot ROBOT one.csv -o again.json --holdout 0.3",
    "identify --effects": "identify --robot ROBOT one.csv -o more.json --effects gain",
    "validate": "validate cal.json other.csv --rows 6:30 --accept 1",
    "compare": "compare cal.json again.json",
    "compare --with": "compare cal.json --with ROBOT --task TASK",
    "fleet": "fleet fleet",
    "performance": "performance cycles.csv",
    "performance --path": "performance passes.csv --path",
    "correct": "correct -c cal.json path.csv -o corrected.csv --accept-uncertain",
    "place": "place --robot ROBOT TASK --region 0,0,0",
    "poses": "poses -c cal.json path.csv",
    "export": "export cal.json --form urdf -o robot.urdf --accept-loss",
    "export --form offsets": "export cal.json --form offsets",
    "report": "report cal.json --task TASK -o page.html",
    "doctor": "doctor swapped.csv --robot ROBOT",
    "doctor alone": "doctor",
    "warm": "warm",
}

SHOWN = {
    name: COMMANDS[name] for name in COMMANDS if name not in ("study", "robots import", "convert", "warm", "plan")
} | {
    "simulate --truth": "simulate --robot ROBOT --task TASK --count 20 -o known.csv --truth known.json",
    "identify --folds": "identify --robot ROBOT three.csv -o folds.json --folds 2 --parameters",
    "identify poses": "identify --robot ROBOT poses.csv -o poses.json",
    "identify --keep none": "identify --robot ROBOT one.csv -o none.json --keep none",
    "validate --reregister": "validate cal.json other.csv --reregister --all-rows --accept 0.001 --accept-of p95",
    "compare": "compare cal.json fleet/a/cal.json --task TASK",
    "report --campaign": "report cal.json --campaign one.csv -o page.html",
    "select --campaign": "select --robot ROBOT --task TASK --campaign one.csv --accuracy-mm 0.1",
    "select -c": "select -c cal.json --task TASK",
    "sensitivity --campaign": "sensitivity --robot ROBOT --campaign one.csv --sort influence",
    "place -c": "place -c cal.json TASK --region=-9:9,0,0 --steps 2 --turn 0:2 --turns 2 --touched-off",
    "poses": "poses --robot ROBOT path.csv --angles abc",
    "poses --reverse": "poses -c cal.json tool.csv",
    "export --form offsets --task": "export cal.json --form offsets --task TASK",
    "export --form dh": "export cal.json --form dh -o table2.csv --accept-loss",
    "correct --task": "correct -c cal.json path.csv -o corrected2.csv --accept-uncertain --task TASK",
    "plan": "plan --robot ROBOT --task TASK --count 16 --candidates 60 -o plan.csv",
    "doctor of a sound campaign": "doctor one.csv --robot ROBOT",
}
"""What people are shown too: most of the commands, and some in other ways."""


@pytest.fixture(scope="module")
def folder(cell: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that these commands read."""
    out = tmp_path_factory.mktemp("keys")
    for file in cell.glob("*.*"):
        (out / file.name).write_bytes(file.read_bytes())
    (out / "fleet" / "a").mkdir(parents=True)
    (out / "fleet" / "a" / "cal.json").write_bytes((cell / "cal.json").read_bytes())
    (out / "table.csv").write_text("joint,alpha_deg,a_mm,d_mm,theta_offset_deg\nJ1,0,500,0,0\nJ2,90,300,200,0\n")
    (out / "path.csv").write_text("J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg\n0,10,20,5,-40,10\n3,12,22,6,-42,12\n")
    (out / "tool.csv").write_text("x_mm,y_mm,z_mm,qx,qy,qz,qw\n1700,20,1450,0,0.955,0,0.296\n")
    swapped = (out / "one.csv").read_text().replace("J4_deg,J5_deg,J6_deg", "J6_deg,J5_deg,J4_deg")
    (out / "swapped.csv").write_text(swapped)
    rng, rows = np.random.default_rng(0), []
    for cycle in range(3):
        for k in range(3):
            attained = 100.0 * k + 0.01 * rng.normal(size=3)
            rows.append([k, cycle, *attained, *[100.0 * k] * 3])
    for name, first in (("cycles.csv", "pose"), ("passes.csv", "section")):
        header = f"{first},cycle,x_mm,y_mm,z_mm,command_x_mm,command_y_mm,command_z_mm"
        (out / name).write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return out


def keys_of(result: dict) -> dict[str, list[str]]:
    """Keys at the top, and of the entries of lists."""
    entries = {
        name: value[0]
        for name, value in result.items()
        if isinstance(value, list) and value and isinstance(value[0], dict)
    }
    return {"top": sorted(result), **{name: sorted(value) for name, value in entries.items()}}


@pytest.mark.parametrize("name", [name for name in COMMANDS if COMMANDS[name] != SHOWN.get(name)])
def test_json_keys(run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """In the order above, since later commands read what earlier ones wrote; of the others, see below."""
    monkeypatch.chdir(folder)
    line = COMMANDS[name].replace("ROBOT", IRB6660).replace("TASK", TASK)
    if name == "compare" and not (folder / "again.json").exists():
        assert run(*COMMANDS["identify"].replace("ROBOT", IRB6660).split()).status == 0
    ended = run(*line.split(), "--json")
    assert ended.out.startswith("{"), ended.err
    assert keys_of(json.loads(ended.out)) == KEYS[name]


_NUMBER = re.compile(
    r"(?<!ratio )(?<!noise )(?<![>≥] )(?<!guard band of )(?<![\w.-])[-−+]?(\d+\.(\d+))(?![\w.]*\w)(?: (mm|mrad|°|%))?"
)
"""A number with decimals, and the unit behind it; no ratio of results, nor what a sentence compares them with."""
_KEYS = {"mm": "mm", "mrad": "mrad", "°": "deg"}
"""What is in the keys of numbers of a unit."""


def numbers_of(value: Any, keys: str = "") -> Iterator[tuple[str, float]]:
    """Numbers of a result without their signs, those in its sentences too, each with all keys above it."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from numbers_of(item, f"{keys}_{key}")
    elif isinstance(value, list):
        for item in value:
            yield from numbers_of(item, keys)
    elif isinstance(value, str):
        yield from (("", float(found)) for found in re.findall(r"\d+(?:\.\d+)?", value))
    elif isinstance(value, int | float):
        yield keys, abs(float(value))


@pytest.mark.parametrize("name", SHOWN)
def test_what_people_are_shown_are_the_numbers_of_the_json(
    run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """To the digits that are shown, and under no key of another unit than stands behind it; and every file that was written."""
    monkeypatch.chdir(folder)
    given: list[Any] = []

    def note(self: OutputOptions, result: Mapping[str, Any], show: Any) -> None:
        given.append(plain(with_edits(result)))
        show()

    monkeypatch.setattr(OutputOptions, "give", note)
    line = SHOWN[name].replace("ROBOT", IRB6660).replace("TASK", TASK).split()
    before = {path: path.stat().st_mtime_ns for path in folder.iterdir()}
    ended = run(*line)
    assert ended.out, ended.err
    written = [path for path in folder.iterdir() if path.is_file() and path.stat().st_mtime_ns != before.get(path)]
    said = "".join((ended.out + ended.err).split())
    assert [path.name for path in written if path.name not in said] == []
    result = given[0] if given else run(*line, "--json").json
    if SHOWN[name] == COMMANDS.get(name):
        assert keys_of(result) == KEYS[name]
    known = list(numbers_of(result))
    text = " ".join(ended.out.split())
    for found in _NUMBER.finditer(text):
        number, decimals, unit = found.groups()
        others = set(_KEYS.values()) - {_KEYS.get(unit)} if unit in _KEYS else set()
        among = [value for keys, value in known if others.isdisjoint(keys.split("_"))]
        off = (1.0 if unit == "%" else 0.5 + 1e-6) * 10.0 ** -len(decimals)  # shares may be rounded down
        scales = (1.0, 100.0) if unit == "%" else (1.0,)
        said = text[max(found.start() - 60, 0) : found.end() + 30]
        assert any(abs(scale * value - float(number)) <= off for value in among for scale in scales), said
