import shutil
import tempfile
from pathlib import Path

import numba.core.config as numba_config
import numpy as np
import pytest

from taskcal.geometry import compiled, normal_equations
from taskcal.geometry.chain import Chain
from taskcal.geometry.observations import Observations, Points, Walked
from taskcal.geometry.walk import Columns

NOTHING = np.empty(0, dtype=np.int64)
NO_COLUMNS = Columns(frames=np.empty((0, 6), dtype=np.int64), joint=NOTHING, column=NOTHING, count=0)
AT_THE_END = Points(np.zeros((1, 3)), np.full((1, 3), -1))


@pytest.fixture
def sources(tmp_path, monkeypatch):
    """A copy of the kernel sources, to be edited, and a cache root of their own."""
    folder = tmp_path / "geometry"
    shutil.copytree(Path(compiled.__file__).parent, folder, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(compiled, "__file__", str(folder / "compiled.py"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    compiled.cache_folder.cache_clear()
    yield folder
    compiled.cache_folder.cache_clear()


def folder_now() -> Path:
    compiled.cache_folder.cache_clear()
    return compiled.cache_folder()


def test_the_folder_stays_while_the_sources_do(sources):
    assert folder_now() == folder_now()
    assert folder_now().is_dir()
    assert folder_now().parent == sources.parent / "cache"


@pytest.mark.parametrize("name", ["walk.py", "four_bar.py", "normal_equations.py"])
def test_an_edit_of_any_kernel_source_starts_a_new_folder(sources, name):
    before = folder_now()
    with (sources / name).open("a") as stream:
        stream.write("\n# edited\n")
    assert folder_now() != before


def test_a_folder_that_cannot_be_made_costs_a_compilation_and_leaves_nothing(sources, monkeypatch, caplog):
    blocked = sources.parent / "file"
    blocked.write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(blocked / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(sources.parent))
    before = sorted(sources.parent.rglob("*"))
    folder_now()
    assert compiled.compiled(kernel)(1.0) == 2.0
    assert "cannot be kept there" in caplog.text
    assert sorted(sources.parent.rglob("*")) == before


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize(
    "damage", [lambda old: b"", lambda old: old[:-9], lambda old: b"\x93" * 99, lambda old: old[:-9] + b"\0" * 9]
)
def test_a_damaged_kernel_is_said_compiled_afresh_and_mended(sources, caplog, suffix, damage):
    compiled._say_once.cache_clear()
    folder_now()
    assert compiled.compiled(kernel)(1.0) == 2.0
    (path,) = folder_now().rglob(f"*.{suffix}")
    path.write_bytes(damage(path.read_bytes()))
    assert compiled.compiled(kernel)(1.0) == 2.0
    assert "is damaged" in caplog.text
    caplog.clear()
    again = compiled.compiled(kernel)
    assert again(1.0) == 2.0
    assert not [record for record in caplog.records if record.levelname != "INFO"]
    assert sum(again.stats.cache_hits.values()) == 1


def test_a_full_disk_is_said_and_the_kernel_runs(sources, monkeypatch, caplog):
    compiled._say_once.cache_clear()
    folder_now()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(compiled._File, "_open_for_write", full)
    assert compiled.compiled(kernel)(1.0) == 2.0
    assert "No space left on device" in caplog.text
    assert str(folder_now()) in caplog.text


def test_a_warm_cache_that_is_read_only_is_used(sources, monkeypatch, caplog):
    folder_now()
    compiled.compiled(kernel)(1.0)

    def read_only(*_, **__):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(compiled.os, "makedirs", read_only)
    monkeypatch.setattr(tempfile, "TemporaryFile", read_only)
    monkeypatch.setattr(compiled._File, "_open_for_write", read_only)
    again = compiled.compiled(kernel)
    assert again(1.0) == 2.0
    assert sum(again.stats.cache_hits.values()) == 1
    assert not [record for record in caplog.records if record.levelname != "INFO"]


def kernel(a):
    return a + 1.0


def test_compiling_leaves_machine_code_in_the_folder(sources):
    assert not list(folder_now().rglob("*.nbc"))
    assert compiled.compiled(kernel)(1.0) == 2.0
    assert list(folder_now().rglob("*.nbc"))


def test_compiling_is_told_once_and_only_where_it_takes_place(sources, caplog):
    caplog.set_level("INFO", "taskcal")
    compiled._announce.cache_clear()
    folder_now()
    assert compiled.compiled(kernel)(1.0) == compiled.compiled(kernel)(1.0) == 2.0
    assert caplog.messages == ["compiling kernels, once: some seconds"]
    compiled._announce.cache_clear()
    assert compiled.compiled(kernel)(1.0) == 2.0
    assert len(caplog.messages) == 1


def test_a_new_cache_is_cold_and_warm_once_a_fit_has_been_compiled(sources, monkeypatch):
    assert not compiled.is_warm()
    monkeypatch.undo()  # back to the cache of this run
    compiled.cache_folder.cache_clear()
    normal_equations.normal_equations(
        Walked(Chain.of([]), np.empty((1, 0)), np.empty((0, 6)), NO_COLUMNS, np.empty((1, 0)), AT_THE_END),
        Observations(np.zeros((1, 1, 3)), None, np.ones((1, 1), dtype=bool)),
        np.eye(3)[None, None],
    )
    assert compiled.is_warm()


def test_compiling_leaves_the_cache_of_other_users_of_numba_alone(sources, monkeypatch):
    monkeypatch.setattr(numba_config, "CACHE_DIR", "elsewhere")
    compiled.compiled(kernel)
    assert numba_config.CACHE_DIR == "elsewhere"
