"""What tests cost: work, work of a process, and waiting are told apart, of one process and of several workers."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TESTS = """
import subprocess, sys, time
import pytest

BUSY = "import time\\nend = time.process_time() + 0.4\\nwhile time.process_time() < end: pass"

@pytest.fixture(scope="module")
def prepared():
    exec(BUSY)

def test_prepared(prepared): pass

@pytest.mark.parametrize("k", range(2))
def test_works(k): exec(BUSY)

def test_starts_a_process(): subprocess.run([sys.executable, "-c", BUSY], check=True)

def test_waits(): time.sleep(0.4)
"""


@pytest.mark.parametrize("workers", ["0", "2"])
def test_work_of_a_process_and_waiting_are_told_apart(workers, tmp_path):
    (tmp_path / "test_some.py").write_text(TESTS)
    command = ["-m", "tests.cost", "-n", workers, "--rootdir", str(tmp_path), "-c", "/dev/null", str(tmp_path)]
    run = subprocess.run([sys.executable, *command], cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert run.returncode == 0, run.stdout + run.stderr
    whole = float(re.search(r"^processor ([\d.]+) s", run.stdout, re.MULTILINE)[1])
    rows = re.findall(r"^ *([\d.]+) % +([\d.]+) % +([\d.]+)s +\S*::(\w+)$", run.stdout, re.MULTILINE)
    seconds = {name: (float(a) * whole / 100.0, float(b) * whole / 100.0, float(c)) for a, b, c, name in rows}
    assert set(seconds) == {"test_prepared", "test_works", "test_starts_a_process", "test_waits", "prepared"}
    for name, least in (("test_prepared", 0.4), ("test_works", 0.8), ("test_starts_a_process", 0.4), ("prepared", 0.4)):
        assert least - 0.02 < seconds[name][0], name
    assert seconds["test_starts_a_process"][1] > 0.38
    assert seconds["test_works"][1] == 0.0
    assert seconds["test_waits"][2] > 0.3
    assert seconds["test_waits"][0] < 0.2
