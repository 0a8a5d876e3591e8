"""taskcal performance."""

from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Run

HEADER = "pose,direction,cycle,command_x_mm,command_y_mm,command_z_mm,x_mm,y_mm,z_mm"
SHIFTS = {"left": 0.0, "right": 0.3}
COMMANDS = {"P1": (1000, 0, 500), "P2": (1400, 300, 500), "P3": (1000, 0, 900)}


@pytest.fixture
def poses(tmp_path: Path) -> Path:
    """Four cycles of three poses from two sides: 1 mm about a point 3 mm (and 0.3 mm more from the right) too far in x."""
    about = [(4.0, 0.0), (2.0, 0.0), (3.0, 1.0), (3.0, -1.0)]
    rows = [
        f"{pose},{way},{cycle},{x},{y},{z},{x + dx + shift},{y + dy},{z}"
        for pose, (x, y, z) in COMMANDS.items()
        for way, shift in SHIFTS.items()
        for cycle, (dx, dy) in enumerate(about)
    ]
    path = tmp_path / "poses.csv"
    path.write_text("\n".join([HEADER, *rows]) + "\n")
    return path


@pytest.fixture
def circle(tmp_path: Path) -> tuple[Path, Path]:
    """A commanded circle, and three passes that are 0.2 mm too large and sampled elsewhere."""
    angles = np.linspace(0.0, 360.0, 361)
    rows = [f"{500 * np.cos(np.radians(a)):.9f},{500 * np.sin(np.radians(a)):.9f},0" for a in angles[:-1]]
    commanded, measured = tmp_path / "path.csv", tmp_path / "passes.csv"
    commanded.write_text("\n".join(["x_mm,y_mm,z_mm", *rows, rows[0]]) + "\n")
    passes = [
        f"{cycle},{500.2 * np.cos(a):.9f},{500.2 * np.sin(a):.9f},0"
        for cycle in range(3)
        for a in np.linspace(-0.001, 2 * np.pi + 0.001, 900 + cycle)
    ]
    measured.write_text("\n".join(["cycle,x_mm,y_mm,z_mm", *passes]) + "\n")
    return measured, commanded


def test_poses_directions_and_distances(run: Run, poses: Path) -> None:
    ended = run("performance", poses, "--json")
    assert ended.status == 0
    assert ended.err == "ISO 9283 requires 30 cycles of a pose; there are 4\n"
    result = ended.json
    assert list(result) == ["poses", "directions", "distances"]
    left, right, *_ = result["poses"]
    assert (left["pose"], left["direction"], left["cycles"]) == ("P1", "left", 4)
    assert left["AP_p_mm"] == pytest.approx(3.0)
    assert right["AP_x_mm"] == pytest.approx(3.3)
    assert left["RP_l_mm"] == pytest.approx(1.0)
    assert [d["vAP_p_mm"] for d in result["directions"]] == pytest.approx([0.3] * 3)
    pairs = [(d["from"], d["to"], d["direction"]) for d in result["distances"]]
    assert pairs == [("P1", "P2", "left"), ("P1", "P2", "right"), ("P2", "P3", "left"), ("P2", "P3", "right")]
    assert all(d["AD_p_mm"] == pytest.approx(0.0, abs=1e-9) for d in result["distances"])


def test_the_tables_for_people(run: Run, poses: Path) -> None:
    ended = run("performance", poses)
    assert ended.status == 0
    assert all(word in ended.out for word in ("AP_p mm", "RP_l mm", "vAP_p mm", "AD_p mm", "RD_p mm", "left"))


def test_passes_along_a_path_of_its_own_file(run: Run, circle: tuple[Path, Path]) -> None:
    measured, commanded = circle
    ended = run("performance", measured, "--command", commanded, "--json")
    assert ended.status == 0
    assert "10 cycles of a path; there are 3" in ended.err
    assert ended.json["AT_p_mm"] == pytest.approx(0.2, rel=0.05)
    assert ended.json["RT_p_mm"] < 0.01
    assert (ended.json["sections"], ended.json["left_out"]) == (361, [])
    assert "AT_p mm" in run("performance", measured, "--command", commanded).out


def test_a_single_pass_with_sections_has_an_accuracy_only(run: Run, tmp_path: Path) -> None:
    header = HEADER.replace("pose,direction", "section")
    rows = [f"s{k},1,{10 * k},0,0,{10 * k},0.5,0" for k in range(5)]
    path = tmp_path / "pass.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    ended = run("performance", path, "--path", "--json")
    assert ended.json["AT_p_mm"] == pytest.approx(0.5)
    assert "RT_p_mm" not in ended.json
    assert "no repeatability" in ended.err
    wrong = run("performance", path)
    assert wrong.status == 1
    assert "--path" in wrong.err
    assert run("performance", path, "--path", "--distance", "s0,s1").status == 2


def test_performance_evaluates_the_distances_asked_for(run: Run, poses: Path, tmp_path: Path) -> None:
    result = run("performance", poses, "--distance", "P1,P3", "--json").json
    assert [(d["from"], d["to"]) for d in result["distances"]] == [("P1", "P3")] * 2
    assert run("performance", poses, "--distance", "P1").status == 2
    unknown = run("performance", poses, "--distance", "P1,P9")
    assert (unknown.status, "no pose 'P9'" in unknown.err) == (1, True)
    apart = tmp_path / "apart.csv"
    apart.write_text("\n".join([HEADER.replace("direction,", ""), "P1,1,0,0,0,0,0,0", "P2,2,1,0,0,1,0,0"]) + "\n")
    alone = run("performance", apart, "--json")
    assert alone.json["distances"] == []
    assert "accuracy but no repeatability" in alone.err
    refused = run("performance", apart, "--distance", "P1,P2")
    assert refused.status == 1
    assert f"error: {apart}: poses 'P1' and 'P2' have no distance" in refused.err


def test_performance_without_commands_is_repeatability(run: Run, tmp_path: Path) -> None:
    (tmp_path / "bare.csv").write_text("pose,cycle,x_mm,y_mm,z_mm\nP1,1,0,0,0\nP1,2,0,0,2\nP2,1,0,0,0\nP2,2,0,0,0\n")
    result = run("performance", tmp_path / "bare.csv", "--json").json
    assert result["poses"][0] == {"pose": "P1", "cycles": 2, "RP_l_mm": pytest.approx(1.0)}
    assert result["distances"] == []


def test_sections_not_crossed_by_a_pass_are_named(run: Run, circle: tuple[Path, Path]) -> None:
    measured, commanded = circle
    lines = measured.read_text().splitlines()
    measured.write_text("\n".join([lines[0], *lines[200:901]]) + "\n")
    ended = run("performance", measured, "--command", commanded, "--json")
    assert ended.json["left_out"][:3] == ["1", "2", "3"]
    assert "of 361 sections are not crossed by every pass and left out" in ended.err


def test_a_path_that_cannot_be_judged_names_the_file(run: Run, circle: tuple[Path, Path]) -> None:
    measured, commanded = circle
    header, *rows = measured.read_text().splitlines()
    measured.write_text("\n".join([header, *reversed(rows)]) + "\n")
    ended = run("performance", measured, "--command", commanded)
    assert (ended.status, ended.out) == (1, "")
    assert f"error: {measured}: pass 0 crosses no plane normal to the path" in ended.err


def test_the_page_says_what_the_terminal_says(run: Run, poses: Path, circle: tuple[Path, Path], tmp_path: Path) -> None:
    page = tmp_path / "performance.html"
    results = run("performance", poses, "--report", page, "--json").json
    text = page.read_text(encoding="utf-8")
    assert f"{max(line['AP_p_mm'] for line in results['poses']):.3f}" in text
    assert f"{max(line['RP_l_mm'] for line in results['poses']):.3f}" in text
    assert text.count("<figure>") == 2
    for title in ("Poses", "Directions of approach", "Distances"):
        assert f". {title}</h2>" in text
    measured, commanded = circle
    result = run("performance", measured, "--command", commanded, "--report", page, "--json").json
    text = page.read_text(encoding="utf-8")
    assert text.count("<figure>") == 1
    assert f"<b>{result['AT_p_mm']:.3f} " in text
    assert run("performance", poses, "--report", poses).status == 1
