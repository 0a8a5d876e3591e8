import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numba.core.config as numba_config
import numpy as np
import pytest

from taskcal.kernels import compiled, kernel_cache, points
from taskcal.kernels.chain import Chain
from taskcal.kernels.points import Points, SeenPoints, Walked
from taskcal.kernels.walk import Columns

NOTHING = np.empty(0, dtype=np.int64)
NO_COLUMNS = Columns(frames=np.empty((0, 6), dtype=np.int64), joint=NOTHING, column=NOTHING, count=0)
AT_THE_END = Points(np.zeros((1, 3)), np.full((1, 3), -1))


@pytest.fixture
def sources(tmp_path, monkeypatch):
    """A copy of the kernel sources, to be edited, and a cache root of their own."""
    folder = tmp_path / "geometry"
    shutil.copytree(Path(compiled.__file__).parent, folder, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(kernel_cache, "__file__", str(folder / "kernel_cache.py"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    kernel_cache.cache_folder.cache_clear()
    yield folder
    kernel_cache.cache_folder.cache_clear()


def folder_now() -> Path:
    kernel_cache.cache_folder.cache_clear()
    return kernel_cache.cache_folder()


def test_the_folder_stays_while_the_sources_do(sources):
    assert folder_now() == folder_now()
    assert folder_now().is_dir()
    assert folder_now().parent == sources.parent / "cache"


@pytest.mark.parametrize("name", ["walk.py", "closure.py", "points.py"])
def test_an_edit_of_any_kernel_source_starts_a_new_folder(sources, name):
    before = folder_now()
    with (sources / name).open("a") as stream:
        stream.write("\n# edited\n")
    assert folder_now() != before


def test_unwritable_cache_folder_recompiles_and_leaves_nothing(sources, monkeypatch, caplog):
    """A cache folder that cannot be created costs one compilation and leaves no file."""
    blocked = sources.parent / "file"
    blocked.write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(blocked / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(sources.parent))
    before = sorted(sources.parent.rglob("*"))
    folder_now()
    assert compiled.compiled(kernel)(1.0) == 2.0
    assert "cannot be kept there" in caplog.text
    assert sorted(sources.parent.rglob("*")) == before


@pytest.mark.parametrize(
    "damage", [lambda old: b"", lambda old: old[:-9], lambda old: b"\x93" * 99, lambda old: old[:-9] + b"\0" * 9]
)
def test_a_damaged_kernel_is_said_compiled_afresh_and_mended(sources, caplog, damage):
    kernel_cache._say_once.cache_clear()
    folder_now()
    assert compiled.compiled(kernel)(1.0) == 2.0
    (path,) = folder_now().rglob("*.nbc")
    path.write_bytes(damage(path.read_bytes()))
    assert compiled.compiled(kernel)(1.0) == 2.0
    assert "is damaged" in caplog.text
    caplog.clear()
    again = compiled.compiled(kernel)
    assert again(1.0) == 2.0
    assert not [record for record in caplog.records if record.levelname != "INFO"]
    assert sum(again.dispatcher.stats.cache_hits.values()) == 1


def test_a_full_disk_is_said_and_the_kernel_runs(sources, monkeypatch, caplog):
    kernel_cache._say_once.cache_clear()
    folder_now()

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tempfile, "mkstemp", full)
    assert compiled.compiled(kernel)(1.0) == 2.0
    assert "No space left on device" in caplog.text
    assert str(folder_now()) in caplog.text


def test_a_warm_cache_that_is_read_only_is_used(sources, monkeypatch, caplog):
    folder_now()
    compiled.compiled(kernel)(1.0)

    def read_only(*_, **__):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(kernel_cache.os, "makedirs", read_only)
    monkeypatch.setattr(tempfile, "TemporaryFile", read_only)
    monkeypatch.setattr(tempfile, "mkstemp", read_only)
    again = compiled.compiled(kernel)
    assert again(1.0) == 2.0
    assert sum(again.dispatcher.stats.cache_hits.values()) == 1
    assert not [record for record in caplog.records if record.levelname != "INFO"]


def kernel(a):
    return a + 1.0


def test_interrupted_cache_write_leaves_no_file(sources, monkeypatch):
    """An interrupt while machine code is written leaves no partial file."""

    def interrupt(*_):
        raise KeyboardInterrupt

    folder_now()
    with monkeypatch.context() as patched:
        patched.setattr(kernel_cache.os, "replace", interrupt)
        with pytest.raises(KeyboardInterrupt):
            compiled.compiled(kernel)(1.0)
    assert not [path for path in folder_now().rglob("*") if path.is_file()]
    assert compiled.compiled(kernel)(1.0) == 2.0
    assert len(list(folder_now().rglob("*.nbc"))) == 1


def test_concurrent_signatures_are_both_cached(sources, monkeypatch):
    """Each has asked for what is there before the other has written."""
    folder_now()
    first, second = compiled.compiled(kernel), compiled.compiled(kernel)
    save = kernel_cache._Files.save

    def after_the_other(files, key, data):
        monkeypatch.setattr(kernel_cache._Files, "save", save)
        second(1)
        save(files, key, data)

    monkeypatch.setattr(kernel_cache._Files, "save", after_the_other)
    first(1.0)
    again = compiled.compiled(kernel)
    assert (again(1.0), again(1)) == (2.0, 2.0)
    assert sum(again.dispatcher.stats.cache_hits.values()) == 2


def test_compiling_leaves_machine_code_in_the_folder(sources):
    assert not list(folder_now().rglob("*.nbc"))
    assert compiled.compiled(kernel)(1.0) == 2.0
    assert list(folder_now().rglob("*.nbc"))


def test_compiling_is_told_once_and_only_where_it_takes_place(sources, caplog):
    caplog.set_level("INFO", "taskcal")
    kernel_cache.announce_compilation.cache_clear()
    folder_now()
    assert compiled.compiled(kernel)(1.0) == compiled.compiled(kernel)(1.0) == 2.0
    assert caplog.messages == ["compiling kernels, once: some seconds"]
    kernel_cache.announce_compilation.cache_clear()
    assert compiled.compiled(kernel)(1.0) == 2.0
    assert len(caplog.messages) == 1


def test_new_cache_is_cold_until_a_fit_is_compiled(sources, monkeypatch):
    """A new cache is cold, and warm once a fit has been compiled."""
    assert not kernel_cache.is_warm()
    monkeypatch.undo()  # back to the cache of this run
    kernel_cache.cache_folder.cache_clear()
    points.normal_equations(
        Walked(Chain.of([]), np.empty((1, 0)), np.empty((0, 6)), NO_COLUMNS, np.empty((1, 0)), AT_THE_END),
        SeenPoints(np.zeros((1, 1, 3)), np.ones((1, 1), dtype=bool)),
        np.eye(3)[None, None],
    )
    assert kernel_cache.is_warm()


def test_compilation_keeps_numba_cache_of_others(sources, monkeypatch):
    """Compilation leaves Numba's cache setting for other packages unchanged."""
    monkeypatch.setattr(numba_config, "CACHE_DIR", "elsewhere")
    compiled.compiled(kernel)
    assert numba_config.CACHE_DIR == "elsewhere"


USES_WHAT_WAS_KEPT = """
import sys
import numpy as np
from taskcal.kernels.chain import Chain, Joint
from taskcal.kernels.walk import poses
assert poses(Chain.of([Joint()]), np.zeros((1, 1)), np.zeros((0, 6))).shape == (1, 4, 4)
print(*[name for name in ("numba.np.arraymath", "scipy.linalg") if name in sys.modules])
"""


def test_machine_code_that_was_kept_runs_without_the_compiler():
    for _ in range(2):  # the first leaves it, if no other test has
        ended = subprocess.run([sys.executable, "-c", USES_WHAT_WAS_KEPT], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == ""


SCRIPT = """
import logging, sys
logging.basicConfig(level=logging.INFO, format="%(message)s")
from taskcal.kernels.compiled import compiled
@compiled
def kernel(a):
    return a + 1.0
assert kernel(1.0) == 2.0
print(sum(kernel.dispatcher.stats.cache_hits.values()))
"""


@pytest.fixture
def start(tmp_path, monkeypatch):
    """Start a process that calls a kernel, with a cache that it shares with others."""
    (tmp_path / "script.py").write_text(SCRIPT)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))

    def begin() -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, str(tmp_path / "script.py")], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    return begin


@pytest.mark.long  # some processes, each of which compiles
def test_concurrent_compilations_do_not_interfere(start):
    """Processes that compile at the same time do not interfere."""
    ended = [process.communicate(timeout=600) for process in [start() for _ in range(3)]]
    assert {said for _, said in ended} <= {"", "compiling kernels, once: some seconds\n"}
    assert all(hits in ("0\n", "1\n") for hits, _ in ended)
    assert start().communicate(timeout=600) == ("1\n", "")


@pytest.mark.long  # some processes, each of which compiles
def test_cache_survives_process_killed_while_compiling(start):
    """A process killed while it compiles leaves a cache that other processes can use."""
    with start() as killed:
        assert killed.stderr.readline() == "compiling kernels, once: some seconds\n"
        killed.kill()
    hits, said = start().communicate(timeout=600)
    assert (hits, said) in (("0\n", "compiling kernels, once: some seconds\n"), ("1\n", ""))
    assert start().communicate(timeout=600) == ("1\n", "")
