"""The keys of every command's JSON, which programs read: none goes, and none comes unseen."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import IRB6660, Run

KEYS = tomllib.loads((Path(__file__).parent / "json_keys.toml").read_text(encoding="utf-8"))
"""By command: the keys of the result, and of the entries of its lists."""

TASK = "list.toml"
COMMANDS = {
    "robots": "robots",
    "robots show": "robots show ROBOT",
    "robots import": "robots import table.csv --convention dh -o robot.toml",
    "simulate": "simulate --robot ROBOT --task TASK --count 20 -o again.csv",
    "sensitivity": "sensitivity --robot ROBOT --task TASK",
    "select": "select --robot ROBOT --task TASK",
    "plan": "plan --robot ROBOT --task TASK --count 8 --candidates 60 -o plan.csv",
    "study": "study --robot ROBOT --task TASK --robots 1 --counts 8 --plans random --engine sequential",
    "convert": "convert one.csv --robot ROBOT -o plain.csv",
    "register": "register --robot ROBOT one.csv",
    "identify": "identify --robot ROBOT one.csv -o again.json --holdout 0.3",
    "identify --effects": "identify --robot ROBOT one.csv -o more.json --effects gain",
    "validate": "validate cal.json one.csv --accept 1",
    "compare": "compare cal.json again.json",
    "fleet": "fleet fleet",
    "performance": "performance cycles.csv",
    "performance --path": "performance passes.csv --path",
    "correct": "correct -c cal.json path.csv -o corrected.csv --accept-uncertain",
    "place": "place --robot ROBOT TASK --region 0,0,0",
    "poses": "poses -c cal.json path.csv",
    "export": "export cal.json --form urdf -o robot.urdf --accept-loss",
    "export --form offsets": "export cal.json --form offsets",
    "report": "report cal.json --task TASK -o page.html",
    "doctor": "doctor one.csv --robot ROBOT",
    "doctor alone": "doctor",
    "warm": "warm",
}


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


@pytest.mark.parametrize("name", COMMANDS)
def test_json_keys(run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """In the order above, since later commands read what earlier ones wrote."""
    monkeypatch.chdir(folder)
    line = COMMANDS[name].replace("ROBOT", IRB6660).replace("TASK", TASK)
    if name == "compare" and not (folder / "again.json").exists():
        assert run(*COMMANDS["identify"].replace("ROBOT", IRB6660).split()).status == 0
    ended = run(*line.split(), "--json")
    assert ended.out.startswith("{"), ended.err
    assert keys_of(json.loads(ended.out)) == KEYS[name]
