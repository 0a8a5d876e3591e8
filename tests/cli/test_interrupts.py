import signal
import subprocess
import sys
import time

import pytest

from taskcal.cli import main

LOOPS = {
    "swallowed": "\n    while True:\n        try: time.sleep(30)\n        except KeyboardInterrupt: pass",
    "taken": "\n    time.sleep(30)",
    "lost in a callback": "\n    while True: ctypes.CFUNCTYPE(None)(lambda: time.sleep(30))()",
    "hanging after": "\n    threading.Thread(target=time.sleep, args=(30,)).start()\n    time.sleep(30)",
}


@pytest.mark.parametrize("kind", LOOPS)
def test_interrupt_ends_command_soon_and_lists_written_files(kind, tmp_path):
    """An interrupt ends the command soon and lists the files already written."""
    table = tmp_path / "table.csv"
    table.write_text("joint,alpha_deg,a_mm,d_mm,theta_offset_deg\nJ1,0,500,0,0\n")
    robot = tmp_path / "r.toml"
    # a shell without job control starts what runs in the background deaf to interrupts, and its children inherit that
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "import ctypes, sys, threading, time; from taskcal.cli import main; from taskcal.robot.importers import dh\n"
        f"def stuck(*_):\n    print('begun', flush=True){LOOPS[kind]}\n"
        "dh.describe_dh_table = stuck\n"
        f"sys.argv = ['taskcal', 'robots', 'import', {str(table)!r}, '--convention', 'dh', '-o', {str(robot)!r}]\n"
        "sys.exit(main())"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as ended:
        assert ended.stdout is not None
        assert ended.stderr is not None
        assert ended.stdout.readline() == "begun\n"
        time.sleep(0.2)  # until it is in the midst of it
        start = time.monotonic()
        ended.send_signal(signal.SIGINT)
        try:
            _, said = ended.communicate(timeout=20)
        finally:
            ended.kill()
        status = ended.returncode
    assert time.monotonic() - start < 5.0
    assert (status, said) == (130, f"interrupted: nothing was written; not written: {robot}\n")


def test_interrupt_during_import_prints_one_line():
    """An interrupt during the import of the command line is reported in one line."""
    with subprocess.Popen(
        [sys.executable, "-X", "importtime", "-m", "taskcal", "robots"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=_hear_interrupts,
    ) as ended:  # fmt: skip
        assert ended.stderr is not None
        while "taskcal.errors" not in ended.stderr.readline():  # of the modules of the command line among the first
            pass
        ended.send_signal(signal.SIGINT)
        out, said = ended.communicate(timeout=20)
    lines = [line for line in said.splitlines() if not line.startswith("import time:")]
    assert (ended.returncode, out, lines) == (130, "", ["interrupted: nothing was written"])


def _hear_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def test_an_interrupt_while_a_class_is_made_is_one_all_the_same(monkeypatch, capsys, tmp_path):
    class Interrupted:
        def __set_name__(self, owner, name):
            raise KeyboardInterrupt

    def stuck(*_):
        type("Made", (), {"field": Interrupted()})

    monkeypatch.setattr("taskcal.robot.importers.dh.describe_dh_table", stuck)
    table = tmp_path / "table.csv"
    table.write_text("joint,alpha_deg,a_mm,d_mm,theta_offset_deg\nJ1,0,500,0,0\n")
    command = ["robots", "import", str(table), "--convention", "dh", "-o", str(tmp_path / "r.toml")]
    assert main(command) == 130
    assert capsys.readouterr().err.startswith("interrupted: nothing was written")
