import signal
import subprocess
import sys
import time

import pytest

LOOPS = {
    "swallowed": "\n    while True:\n        try: time.sleep(30)\n        except KeyboardInterrupt: pass",
    "taken": "\n    time.sleep(30)",
    "hanging after": "\n    threading.Thread(target=time.sleep, args=(30,)).start()\n    time.sleep(30)",
}


@pytest.mark.parametrize("kind", LOOPS)
def test_an_interrupt_ends_the_program_soon_and_says_what_was_written(kind, tmp_path):
    table = tmp_path / "table.csv"
    table.write_text("joint,alpha_deg,a_mm,d_mm,theta_offset_deg\nJ1,0,500,0,0\n")
    robot = tmp_path / "r.toml"
    # a shell without job control starts what runs in the background deaf to interrupts, and its children inherit that
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "import sys, threading, time; from taskcal.cli import main; from taskcal.robot import dh_table\n"
        f"def stuck(*_):\n    print('begun', flush=True){LOOPS[kind]}\n"
        "dh_table.describe_dh_table = stuck\n"
        f"sys.argv = ['taskcal', 'robots', 'import', {str(table)!r}, '--convention', 'dh', '-o', {str(robot)!r}]\n"
        "sys.exit(main())"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as ended:
        assert ended.stdout is not None
        assert ended.stderr is not None
        assert ended.stdout.readline() == "begun\n"
        start = time.monotonic()
        ended.send_signal(signal.SIGINT)
        try:
            _, said = ended.communicate(timeout=20)
        finally:
            ended.kill()
        status = ended.returncode
    assert time.monotonic() - start < 5.0
    assert (status, said) == (130, f"interrupted: nothing was written; not written: {robot}\n")
