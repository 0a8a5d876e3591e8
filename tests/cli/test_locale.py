"""Names of files that the locale cannot decode: every command reads and writes them, and states them in text that can be read."""

import io
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from taskcal.cli.output import write_json
from tests.cli.conftest import IRB6660

COMMANDS = """
import sys
from taskcal.cli import main

robot, campaign, calibration, registration, table, imported, page, program = sys.argv[1:]
for arguments in (
    ["register", campaign, "--robot", robot, "-o", registration],
    ["identify", campaign, "--robot", robot, "-o", calibration, "--effects", "none", "--json"],
    ["validate", calibration, campaign, "--json"],
    ["report", calibration, "-o", page],
    ["robots", "import", table, "--convention", "dh", "-o", imported],
    ["correct", "-c", calibration, program, "--dry-run"],
    ["doctor", campaign + ".csv", "--robot", robot],
):
    print("status", main(arguments))
"""

DH = """joint,alpha_deg,a_mm,d_mm,theta_offset_deg
1,-90,0,290,0
2,0,270,0,-90
3,-90,70,0,0
4,90,0,302,0
5,-90,0,0,0
6,0,0,72,180
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="file systems elsewhere take no other names than text")
def test_commands_take_names_that_the_locale_does_not_decode(cell: Path, tmp_path: Path) -> None:
    """In the C locale, an umlaut and a byte that is no text in any name are read, written, printed and shown on pages."""
    folder = os.path.join(os.fsencode(tmp_path), "ü".encode())
    os.mkdir(folder)
    campaign, calibration, registration, table, _imported, page, program = files = [
        os.path.join(folder, b"\xff" + ending)
        for ending in (b".csv", b".json", b"-r.json", b"-dh.csv", b".toml", b".html", b"-p.csv")
    ]
    shutil.copy(cell / "one.csv", campaign)
    shutil.copy(cell / "list.csv", program)
    Path(os.fsdecode(table)).write_text(DH)
    done = subprocess.run(
        [sys.executable, "-c", COMMANDS, IRB6660, *files],
        capture_output=True,
        env={**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        check=False,
    )
    said, reasons = done.stdout.decode("ascii"), done.stderr.decode("ascii")
    assert "itself failed" not in reasons, reasons
    assert re.findall(r"^status (\d)$", said, re.MULTILINE) == ["0"] * 6 + ["1"], (said, reasons)
    stated = json.loads(said[said.index("{") : said.index("\n}\n") + 2])
    assert stated["calibration"].encode("ascii", "surrogateescape") == calibration
    assert Path(os.fsdecode(page)).read_bytes().decode("utf-8")
    assert json.loads(Path(os.fsdecode(registration)).read_bytes().decode("utf-8"))


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_json_reads_back_whatever_the_terminal_can_show(encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    content = {"σ of \udcff": "ü\x7f"}
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding, errors="replace")
    monkeypatch.setattr(sys, "stdout", stream)
    write_json(content)
    stream.seek(0)
    assert json.loads(stream.read()) == content
