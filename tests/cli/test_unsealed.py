"""A calibration that was edited: refused by every command, or read with --unsealed, and then every result says so."""

import json
from pathlib import Path

import pytest

from tests.cli.conftest import Run

WARNING = "not as it was identified: edited.json (edited: estimate)"

COMMANDS = {
    "report": ["report", "edited.json", "-o", "page.html"],
    "validate": ["validate", "edited.json", "one.csv"],
    "compare": ["compare", "cal.json", "edited.json"],
    "export": ["export", "edited.json", "--form", "urdf", "-o", "robot.urdf", "--accept-loss"],
    "export dh": ["export", "edited.json", "--form", "mdh", "-o", "robot.csv", "--accept-loss"],
    "export offsets": ["export", "edited.json", "--form", "offsets", "-o", "offsets.json"],
    "poses": ["poses", "one.csv", "-c", "edited.json", "-o", "poses-out.csv"],
    "plan": [
        "plan", "-c", "edited.json", "-t", "task.toml", "-n", "10", "--candidates", "60", "-o", "plan.csv",
        "--report", "page.html",
    ],
    "place": [
        "place", "task.toml", "-c", "edited.json", "--region", "0,0,0", "-o", "map.csv", "--report", "page.html",
    ],
    "correct": ["correct", "part.mod", "-c", "edited.json", "-o", "out.mod", "--report", "page.html"],
    "identify": ["identify", "one.csv", "--robot", "abb-irb6660-205-1.9", "--like", "edited.json", "-o", "new.json"],
}  # fmt: skip

TEXTS = ("page.html", "robot.urdf", "robot.csv", "offsets.json")

PROGRAM = """MODULE Part
PROC main()
MoveJ [[1700,30,1500],[0,0.955,0,0.296],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;
ENDPROC
ENDMODULE
"""


@pytest.fixture
def folder(cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("cal.json", "one.csv", "task.toml"):
        (tmp_path / name).write_bytes((cell / name).read_bytes())
    content = json.loads((cell / "cal.json").read_text())
    content["estimate"][3] += 5e-5
    (tmp_path / "edited.json").write_text(json.dumps(content))
    (tmp_path / "part.mod").write_text(PROGRAM)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("command", COMMANDS)
def test_edited_calibration_is_refused_or_said_everywhere(command: str, folder: Path, run: Run) -> None:
    before = {path.name for path in folder.iterdir()}
    refused = run(*COMMANDS[command])
    assert refused.status == 1
    assert "edited.json: was edited after it was written: 'estimate' changed" in refused.err
    assert {path.name for path in folder.iterdir()} == before
    said = run(*COMMANDS[command], "--unsealed")
    assert f"warning: {WARNING}" in " ".join(said.out.split())
    made = [folder / name for name in TEXTS if (folder / name).exists()]
    assert bool(made) == any(name in COMMANDS[command] for name in TEXTS)
    for path in made:
        assert WARNING.removeprefix("not as it was identified: ") in path.read_text().replace("\\", "")
    more = ["--force"] if "-o" in COMMANDS[command] else []
    assert run(*COMMANDS[command], "--unsealed", "--json", *more).json["edited"] == [WARNING]


def test_what_was_not_edited_says_nothing(folder: Path, run: Run) -> None:
    ended = run("validate", "cal.json", "one.csv", "--unsealed", "--json")
    assert ended.status == 0
    assert "edited" not in ended.json
    assert ended.json["off_stored_mm"] < 1e-9


def test_a_fleet_names_what_was_edited(folder: Path, run: Run) -> None:
    (folder / "fleet" / "a").mkdir(parents=True)
    for name in ("cal.json", "edited.json"):
        (folder / name).rename(folder / "fleet" / "a" / name)
    assert run("fleet", "fleet", "--json").status == 1
    rows = run("fleet", "fleet", "--unsealed", "--json").json["calibrations"]
    assert [row["file"] for row in rows] == ["a/cal.json", "a/edited.json (edited: estimate)"]


@pytest.mark.parametrize("key", ["estimate", "residuals", "q", "T_tracker_base", "ids"])
def test_fitted_campaign_that_misses_its_residuals_fails(key: str, folder: Path, run: Run) -> None:
    content = json.loads((folder / "cal.json").read_text())
    match key:
        case "estimate":
            content[key] = content[key][::-1]
        case "residuals":
            content[key][7][0][0] += 1e-6
        case "q":
            content[key][7][0] += 1e-4
        case "ids":
            content[key] = content[key][::-1]
        case _:
            content[key][0][3] += 0.03
    (folder / "edited.json").write_text(json.dumps(content))
    ended = run("validate", "edited.json", "one.csv", "--unsealed")
    assert ended.status == 1
    assert "stored residuals of this campaign, to which it was fitted, are not met" in ended.err
