"""What a version says at its rim: helps, results and refusals of the command line, and what the studio's pages ask of it.

    python -m tests.goldens keep FOLDER
    python -m tests.goldens compare FOLDER

The first one keeps what the version on the path says, each in a file of its own; the second one says it again, and lists what is
not equal, line by line; its exit status is 1 if there is anything. So an older version is asked once, where it is checked out, and
every change of a help text, of a key or of an argument is seen by whoever means it.

Both work on the studio's example project, whose robot is simulated, in a folder of their own.
"""

import argparse
import difflib
import io
import os
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from typer.main import get_command

from taskcal.cli import app, main
from taskcal_studio.pages import identify_page, live_page, plan_page, program_page, report_page
from taskcal_studio.project import Choices, Project, begin_example

ROBOT, CAMPAIGN, TASK, PROGRAM = (
    "abb-irb6660-205-1.9", "campaigns/measured.csv", "tasks/milling.toml", "programs/Milling.mod",
)  # fmt: skip
TO_FIT, OF_TASK = f"--robot {ROBOT} {CAMPAIGN}", f"--robot {ROBOT} --task {TASK}"

RESULTS = {
    "identify": f"identify {TO_FIT} -o cal.json --holdout 0.3",
    "identify-folds": f"identify {TO_FIT} -o folds.json --folds 3 --target-within-mm 500 --model-error-mm 0.05",
    "identify-effects": f"identify {TO_FIT} -o gains.json --effects gain --prior-scale 2 --mpe-to-sigma 0.577 --holdout-by blocks "
    "--holdout 0.25 --seed 3",
    "identify-kept": f"identify {TO_FIT} -o kept.json --keep J2,J3 --prior none --gross-errors keep --rows 0:50",
    "robots": "robots",
    "robots-show": f"robots show {ROBOT}",
    "sensitivity": f"sensitivity {OF_TASK}",
    "select": f"select {OF_TASK}",
    "simulate": f"simulate {OF_TASK} --count 20 -o again.csv",
    "plan": f"plan {OF_TASK} --count 8 --candidates 60 -o plan.csv",
    "study": f"study {OF_TASK} --robots 1 --counts 8 --plans random --engine sequential",
    "board": "board --kind circles --columns 5 --rows 7 --square-mm 20 --marker-mm 9 -o sheet.pdf",
    "convert": f"convert {CAMPAIGN} --robot {ROBOT} -o plain.csv",
    "register": f"register {TO_FIT} -o reg.json",
    "identify-like": f"identify {TO_FIT} -o like.json --like cal.json --registration reg.json",
    "validate": f"validate cal.json {CAMPAIGN} --accept 1",
    "compare": "compare cal.json folds.json",
    "correct": f"correct -c cal.json {PROGRAM} -o corrected.mod --accept-uncertain",
    "place": f"place --robot {ROBOT} {TASK} --region 0,0,0",
    "export": "export cal.json --form urdf -o robot.urdf --accept-loss",
    "report": f"report cal.json --task {TASK} -o page.html",
    "doctor": f"doctor {CAMPAIGN} --robot {ROBOT}",
    "measure": f"measure {OF_TASK} -c virtual -i virtual -o live.csv --most 20 --shots 3",
    "fleet": "fleet .",
}
"""Command lines whose JSON and text are kept; later ones read what earlier ones wrote."""

FIT = f"identify {TO_FIT} -o no.json"
REFUSED = {
    "holdout-zero": f"{FIT} --holdout 0",
    "holdout-beyond": f"{FIT} --holdout 1.5",
    "holdout-no-number": f"{FIT} --holdout nan",
    "holdout-twice": f"{FIT} --holdout 0.3 --folds 3",
    "holdout-of-nothing": f"{FIT} --holdout-by blocks",
    "folds-of-one": f"{FIT} --folds 1",
    "rows-held-out": f"{FIT} --rows 0:20 --holdout 0.3",
    "rows-unknown": f"{FIT} --rows 900:",
    "rows-malformed": f"{FIT} --rows a:b",
    "auto-without-prior": f"{FIT} --effects auto --prior none",
    "no-such-effect": f"{FIT} --effects springs",
    "effects-twice": f"{FIT} --effects gain,gain",
    "effects-auto-and": f"{FIT} --effects auto,gain",
    "keep-empty": f"{FIT} --keep J2,,J3",
    "keep-unknown": f"{FIT} --keep J9",
    "keep-unpublished": f"{FIT} --keep published --lengths-only",
    "prior-scale-without": f"{FIT} --prior none --prior-scale 2",
    "prior-scale-beyond": f"{FIT} --prior-scale 1e9",
    "like-without-prior": f"{FIT} --prior none --like cal.json",
    "model-error-negative": f"{FIT} --model-error-mm=-1",
    "model-error-beyond": f"{FIT} --model-error-mm 2000",
    "target-beyond": f"{FIT} --target-within-mm 1e6",
    "loss-gone": f"{FIT} --loss huber",
    "markdown-gone": "report cal.json --markdown words.md",
    "figures-as-pixels": "report cal.json --figures drawn --figure-format png",
    "mpe-beyond": f"{FIT} --mpe-to-sigma 0",
    "seed-negative": f"{FIT} --holdout 0.3 --seed=-1",
    "no-registration": f"{FIT} --registration reg2.json",
    "columns-too-few": f"{FIT} --columns A",
    "angles-unknown": f"{FIT} --angles xyz",
    "images-without-board": f"{FIT} --images shots",
    "camera-without-board": f"{FIT} --camera camera.toml",
    "times-without-images": f"{FIT} --image-times names",
    "exact-without-camera": f"{FIT} --camera-exact",
    "plan-count": f"plan {OF_TASK} --count 0 -o no.csv",
    "plan-candidates": f"plan {OF_TASK} --candidates 1 -o no.csv",
    "plan-model-error": f"plan {OF_TASK} --model-error-mm=-1 -o no.csv",
    "plan-observe": f"plan {OF_TASK} --observe nothing -o no.csv",
    "plan-roll": f"plan {OF_TASK} --observe pixels --roll-deg 400 -o no.csv",
    "simulate-count": f"simulate {OF_TASK} --count 0 -o no.csv",
    "measure-most": f"measure {OF_TASK} -c virtual -i virtual -o no.csv --most 0",
    "measure-settle": f"measure {OF_TASK} -c virtual -i virtual -o no.csv --settle-s 100",
    "correct-beyond": f"correct -c cal.json {PROGRAM} -o no.mod --max-shift-mm=-1",
    "select-accuracy": f"select {OF_TASK} --accuracy-mm=-1",
    "study-counts": f"study {OF_TASK} --counts 0",
}
"""Command lines that are refused, whose words are kept."""

BEGUN: Mapping[str, Any] = {"robot": ROBOT, "campaign": CAMPAIGN, "task": TASK, "program": PROGRAM}
STATED: Mapping[str, Mapping[str, Any]] = {
    "begun": {},
    "fitted": {"seed": 7, "options": {"identify": {"effects": "auto", "holdout": "0.2", "seed": "7"}}},
    "listed": {"fit_name": "mine", "options": {"identify": {"effects": "gain,spring(J2)", "holdout": ""}}},
    "images": {"observe": "pixels", "board": "boards/b.toml", "camera": "cameras/c.toml", "lens": "fisheye"},
    "placed": {
        "observe": "pixels",
        "board": "boards/b.toml",
        "fixtures": "fixtures/f.csv",
        "observing": {"roll-deg": "5"},
    },
    "planned": {"poses": 30, "seed": 2, "kept_out": 5, "station": "stations/s.toml", "language": "KRL"},
    "live": {"live": {"controller": "virtual", "instrument": "virtual", "shots": "4", "settle-s": "0.5"}},
    "corrected": {
        "calibration": "calibrations/c.json",
        "tool": "t",
        "part": "p",
        "nominal_controller": True,
        "helper": True,
    },
}
"""What projects state beside the beginning."""


MOST_SHOWN = 200
"""Characters of a line that differs."""


def helps() -> Iterator[tuple[str, str]]:
    """The help of every command, and of those below it."""
    group: Any = get_command(app)
    yield "taskcal", said("--help")
    for name, command in group.commands.items():
        yield name, said(name, "--help")
        for inner in getattr(command, "commands", {}):
            yield f"{name}-{inner}", said(name, inner, "--help")


def said(*arguments: str) -> str:
    """What a run prints, on either stream."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        status = main(arguments)
    return f"{out.getvalue()}{err.getvalue()}" + (f"exit status {status}\n" if status else "")


def results(lines: Mapping[str, str], *more: str) -> Iterator[tuple[str, str]]:
    """What command lines print, but for what no two runs have in common: dates, durations, digests and folders."""
    for name, line in lines.items():
        text = said(*line.split(), *more)
        text = re.sub(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d[\d:.+Z]*", "DATE", text)
        text = re.sub(r'("\w*(?:_s|sha256|seal|digest|checksum)": )[^,\n}]*', r"\1…", text)
        yield name, text.replace(os.getcwd(), "FOLDER")


def pages(project: Project) -> Iterator[tuple[str, str]]:
    """Argument lists of every page, one argument a line, for what projects state."""
    begun = project.choices
    for name, stated in STATED.items():
        choices = project.choose(**{**Choices(name=begun.name).model_dump(), **BEGUN, **stated})
        asked = {
            "identify": lambda choices=choices: identify_page.arguments_of(project)[0],
            "plan": lambda choices=choices: plan_page.arguments_of(choices),
            "live": lambda choices=choices: live_page.arguments_of(choices, resume=False, drive=True),
            "program": lambda choices=choices: program_page.arguments_of(project, choices),
            "report": lambda choices=choices: report_page.arguments_of(project),
        }
        for page, make in asked.items():
            yield f"{page}-{name}", "\n".join(make()) + "\n"


def everything() -> Iterator[tuple[str, str]]:
    """Every text, by its name, in a new example project."""
    os.environ.update(COLUMNS="120", TERM="dumb")
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        project = begin_example(Path(folder))
        for kind, texts in (
            ("help", helps()),
            ("json", results(RESULTS, "--json")),
            ("text", results(RESULTS)),
            ("refused", results(REFUSED)),
            ("arguments", pages(project)),
        ):
            for name, text in texts:
                yield f"{kind}-{name}", text
        os.chdir("/")


def keep(place: Path) -> int:
    """Keep every text in a file."""
    place.mkdir(parents=True, exist_ok=True)
    for name, text in everything():
        (place / f"{name}.txt").write_text(text, encoding="utf-8")
    return 0


def compare(place: Path) -> int:
    """List what is not as it was kept."""
    kept = {path.stem: path.read_text(encoding="utf-8") for path in place.glob("*.txt")}
    now = dict(everything())
    for name in sorted(kept.keys() | now.keys()):
        before, after = (texts.get(name, "").splitlines() for texts in (kept, now))
        lines = difflib.unified_diff(before, after, f"before/{name}", f"after/{name}", lineterm="", n=1)
        print(*(line[:MOST_SHOWN] for line in lines), sep="\n", end="" if before == after else "\n")
    return int(kept != now)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Keep or compare what a version says at its rim.")
    parser.add_argument("what", choices=("keep", "compare"))
    parser.add_argument("folder", type=Path)
    asked = parser.parse_args()
    sys.exit({"keep": keep, "compare": compare}[asked.what](asked.folder.resolve()))
