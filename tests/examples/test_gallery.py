"""The gallery shows figures that its own commands make."""

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from taskcal.cli import main
from taskcal.identification.calibration import load_calibration
from taskcal.report.content import Chart, Viewer

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def gallery() -> ModuleType:
    pytest.importorskip("PIL")
    spec = importlib.util.spec_from_file_location("draw_gallery", DOCS / "draw_gallery.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_its_commands_run_and_make_the_figures_that_it_shows(
    gallery: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A browser is not asked: which figures there are is known from the page."""
    from taskcal.report import page as figure_files

    names: list[str] = []

    def note(page, kind):
        figures = [b for section in page.sections for b in section.blocks if isinstance(b, Chart | Viewer)]
        names.extend(f"{figure_files.figures_of(page)[figure.title]}.{kind}" for figure in figures)
        return {}

    monkeypatch.setattr(figure_files, "draw_figures", note)
    monkeypatch.setenv("TASKCAL_BROWSER", sys.executable)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "task.toml").write_text(gallery.task())
    assert len(gallery.commands()) == 3
    for words in gallery.commands():
        assert main(words) == 0
    held_out = load_calibration("cal.json").held_out
    nominal, after = held_out.nominal_validation.mean * 1e3, held_out.validation.mean * 1e3
    page = re.sub(r"\s+", " ", (DOCS / "gallery.md").read_text(encoding="utf-8"))
    assert f"Measured at 60 poses: {nominal:.2f} mm mean 3D error" in page
    assert f"scale 1000:1), {after:.3f} mm calibrated (solid), at held-out poses" in page
    shown = gallery.pictures()
    assert len(shown) == (DOCS / "gallery.md").read_text(encoding="utf-8").count("![")
    for picture, figure in shown:
        assert (DOCS / "_static" / picture).is_file()
        assert [name for name in names if figure in name], figure
