"""What the README and the tutorial show works as it is written there."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from taskcal.diagnosis.diagnose import MISTAKES

ROOT = Path(__file__).parents[2]


def blocks(page: str, language: str) -> list[str]:
    """Fenced blocks of a page."""
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)


def figures(text: str) -> list[str]:
    """Numbers of a text with all their digits, in order, however its lines break."""
    return re.findall(r"\d+(?:\.\d+)?", text)


def run(*arguments: str, folder: Path) -> str:
    done = subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, encoding="utf-8", timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout


COMMANDS = """
import io, json, sys
from contextlib import redirect_stdout
from taskcal.cli import main
printed = []
for line in sys.argv[1:]:
    with redirect_stdout(io.StringIO()) as out:
        status = main(line.split())
    if status:
        sys.exit(status)
    printed.append(out.getvalue())
print(json.dumps(printed))
"""


def taskcal(*lines: str, folder: Path) -> list[str]:
    """What commands print, one after the other in one process, since every process imports a second's worth."""
    return json.loads(run("-c", COMMANDS, *lines, folder=folder))


def test_the_readme_s_example_prints_what_it_says(tmp_path):
    (example,) = blocks("README.md", "python")
    example += "\nprint(tc.validate(tc.identify(model, fitted, keep=[]), held_out).mean * 1e3)"
    printed = run("-c", example, folder=tmp_path)
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    said, frames_only = re.search(r"It prints ([\d.]+) mm.*?`keep=\[\]`\) it is ([\d.]+) mm", page).groups()
    assert printed.split()[0] == said
    assert f"{float(printed.split()[-1]):.1f}" == frames_only


@pytest.mark.slow
def test_the_tutorial_s_road_leads_where_it_says(tmp_path):
    page = "docs/tutorial/index.md"
    tolerances, task = blocks(page, "toml")
    (tmp_path / "table.csv").write_text(next(b for b in blocks(page, "text") if b.startswith("joint,")))
    (tmp_path / "task.toml").write_text(task)
    (tmp_path / "other.toml").write_text(re.sub(r"(cone|spin)_deg.*\n", "", task))
    taskcal("robots import table.csv --convention dh --name my-robot -o my-robot.toml", folder=tmp_path)
    with (tmp_path / "my-robot.toml").open("a") as robot:
        robot.write("\n" + tolerances)
    simulate, identify = "simulate --robot my-robot.toml", "identify --robot my-robot.toml --json"
    printed = taskcal(
        f"{simulate} --task task.toml --count 100 -o campaign.csv --truth truth.json",
        f"{simulate} --task other.toml --count 40 -o other.csv",
        f"{identify} campaign.csv -o cal.json --holdout 0.4",
        "identify --robot my-robot.toml campaign.csv -o cal.json --holdout 0.4",
        f"{identify} other.csv -o one.json",
        "validate cal.json other.csv --json",
        "validate one.json campaign.csv --json",
        folder=tmp_path,
    )
    shown = printed.pop(3)
    said = next(b for b in blocks(page, "text") if "identify --robot my-robot.toml campaign.csv" in b)
    assert figures(shown.partition("next ")[0]) == figures(said.partition("\n")[2].partition("next ")[0])
    found, one, predicted, astray = map(json.loads, printed[2:])
    assert f"{found['held_out']['mean_mm']:.3f}" in shown
    assert not one["targets"]["tool"]["located"]
    rows = re.findall(r"^ predicted (.*)$", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
    keys = ("max_x_mm", "max_y_mm", "max_z_mm", "max_mm", "mean_mm", "rms_mm", "p95_mm")
    assert [row.split()[:-1] for row in rows] == [[f"{one[key]:.3f}" for key in keys] for one in (predicted, astray)]
    (use,) = blocks(page, "python")
    assert "target in the tracker's frame" in run("-c", use, folder=tmp_path)


@pytest.mark.long
def test_every_mistake_of_the_doctor_is_on_its_page():
    page = (ROOT / "docs/how-to/what-is-wrong.md").read_text(encoding="utf-8")
    assert MISTAKES.keys() <= {*re.findall(r"`([a-z-]+)`", page)}


def test_the_plan_of_the_guide_is_worth_what_it_says(tmp_path):
    tolerances, task = blocks("docs/tutorial/index.md", "toml")
    table = next(b for b in blocks("docs/tutorial/index.md", "text") if b.startswith("joint,"))
    (tmp_path / "table.csv").write_text(table)
    (tmp_path / "task.toml").write_text(task)
    taskcal("robots import table.csv --convention dh --name my-robot -o my-robot.toml", folder=tmp_path)
    with (tmp_path / "my-robot.toml").open("a") as robot:
        robot.write("\n" + tolerances)
    (printed,) = taskcal("plan --robot my-robot.toml --task task.toml --count 40 -o plan.csv", folder=tmp_path)
    shown = blocks("docs/how-to/choose-measuring-poses.md", "text")[0]
    for line in ("this plan", "random poses", "space-filling poses", "nominal (registered)"):
        (said,), (found,) = (
            re.findall(rf"^ *{re.escape(line)} +([\d.]+)", text, re.MULTILINE) for text in (shown, printed)
        )
        assert float(found) == pytest.approx(float(said), rel=0.01), line
