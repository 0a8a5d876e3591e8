"""taskcal report, and the pages of sensitivity and select."""

from hashlib import sha256
from pathlib import Path

import pytest

from tests.cli.conftest import IRB6660, Run

PATH = "\n".join(
    [
        "x_mm,y_mm,z_mm,qx,qy,qz,qw",
        *(f"{1650 + 10 * (k * k % 13)},{10 * k},{1400 + 10 * (k * 5 % 11)},0,0.955,0,0.296" for k in range(12)),
    ]
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A task that is a path."""
    (tmp_path / "path.csv").write_text(PATH)
    (tmp_path / "path.toml").write_text('name = "line"\npath = "path.csv"\n')
    return tmp_path / "path.toml"


def figures(page: Path) -> int:
    text = page.read_text(encoding="utf-8")
    assert "http" not in text[text.index("<body>") :].replace("http://www.w3.org", "")
    return text.count("<figure>")


def test_a_calibration_over_a_workspace(run: Run, cell: Path, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    ended = run("report", cell / "cal.json", "--task", cell / "task.toml", "-o", page, "--json")
    assert (ended.status, ended.err) == (0, "")
    result = ended.json
    assert result["target_mm"] < result["after_mm"] < result["before_mm"]
    assert result["target_mm"] < 0.02
    assert figures(page) == 9
    assert ("No outliers" in page.read_text(encoding="utf-8")) == (result["outliers"] == 0)


def test_the_head_and_every_section_of_a_page(run: Run, cell: Path, tmp_path: Path) -> None:
    page, head = (tmp_path / name for name in ("r.html", "head.toml"))
    head.write_text('customer = "Example & Sons"\nserial_number = "6660-1"\ntemperature_C = 21.5\ndate = 2026-11-20\n')
    both = ["--header", head, "-o", page, "--campaign", cell / "one.csv"]
    ended = run("report", cell / "cal.json", *both)
    assert ended.status == 0
    assert " ".join(ended.out.split()).endswith(f"wrote {page}")
    text = page.read_text(encoding="utf-8")
    for said in ("Example &amp; Sons", "21.5 °C", "2026-11-20"):
        assert said in text
    for title in (
        "Summary",
        "Uncertainty of a predicted position",
        "Error reduction by model stage",
    ):
        assert f". {title}</h2>" in text
    assert "µm" not in text[text.index("<main>") : text.index("</main>")]
    head.write_text('costumer = "Example"\n')
    wrong = run("report", cell / "cal.json", "--header", head, "-o", page)
    assert (wrong.status, wrong.out) == (1, "")
    assert "'costumer' is not a known key" in wrong.err


def test_figures_need_a_browser_a_format_and_a_folder(
    run: Run, cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = tmp_path / "r.html"
    monkeypatch.setenv("TASKCAL_BROWSER", "no-such-browser")
    figured = ["report", cell / "cal.json", "-o", page, "--figures", tmp_path / "figures"]
    without = run(*figured)
    assert (without.status, without.out) == (1, "")
    assert "TASKCAL_BROWSER names no-such-browser, which is not a program" in without.err
    for pixels in ("gif", "png"):
        assert f"'{pixels}' is not one of 'svg', 'pdf'" in run(*figured, "--figure-format", pixels).err
    printed = run("report", cell / "cal.json", "-o", page, "--certificate", tmp_path / "c.pdf")
    assert (printed.status, printed.err) == (1, without.err)
    assert not page.exists()
    monkeypatch.setenv("TASKCAL_BROWSER", "python3")
    assert "no folder" in run("report", cell / "cal.json", "-o", page, "--figures", tmp_path / "a" / "b").err


def test_a_calibration_along_a_path_and_without_a_task(run: Run, cell: Path, path: Path, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    said = run("report", cell / "cal.json", "--task", path, "-o", page).out
    assert "Standard uncertainty over line, " in " ".join(said.split())
    assert "95 % intervals pose by pose" in page.read_text(encoding="utf-8")
    assert run("report", cell / "cal.json", "-o", page).status == 0
    assert figures(page) == 8


def test_what_the_remainder_goes_with(run: Run, cell: Path, tmp_path: Path) -> None:
    page, cal = tmp_path / "report.html", cell / "cal.json"
    ended = run("report", cal, "--campaign", cell / "one.csv", "-o", page, "--json")
    assert (ended.status, ended.err) == (0, "")
    remainder = ended.json["remainder"]
    assert 0.01 < remainder["tracker_mm"] < 0.1
    assert remainder["rms_mm"] < 2 * remainder["tracker_mm"]
    assert "position of J2" in {e["quantity"] for e in remainder["explained"]}
    assert all(e["share"] < 0.2 for e in remainder["explained"])
    assert figures(page) >= 3
    assert "Residual analysis" in page.read_text(encoding="utf-8")
    shown = run("report", cal, "--campaign", cell / "one.csv", "-o", page).out
    assert "Residual variance explained, by quantity" in shown
    other = run("report", cal, "--campaign", cell / "three.csv", "-o", page)
    assert (other.status, other.out) == (1, "")
    assert f"{cell / 'three.csv'}: the campaign's targets are" in other.err
    assert run("report", cal, "--campaign", cell / "nowhere.csv", "-o", page).status == 1
    assert run("report", cal, "--campaign", page, "-o", page).status == 1


@pytest.mark.parametrize("campaign", ["poses", "three"])
def test_report_takes_poses_and_several_targets(run: Run, cell: Path, tmp_path: Path, campaign: str) -> None:
    calibration = tmp_path / "cal.json"
    assert run("identify", "--robot", IRB6660, cell / f"{campaign}.csv", "-o", calibration).status == 0
    ended = run("report", calibration, "--task", cell / "task.toml", "-o", tmp_path / "r.html", "--json")
    assert ended.status == 0
    assert ended.json["after_mm"] < ended.json["before_mm"]


def test_a_calibration_of_frames_alone(run: Run, cell: Path, tmp_path: Path) -> None:
    frames = ["--robot", IRB6660, cell / "one.csv", "--keep", "none", "-o", tmp_path / "cal.json"]
    found = run("identify", *frames, "--json").json
    assert found["parameters"] == []
    assert found["fitted"]["mean_mm"] > 0.1
    assert run("identify", *frames).status == 0
    assert run("report", tmp_path / "cal.json", "--task", cell / "task.toml", "-o", tmp_path / "r.html").status == 0
    assert figures(tmp_path / "r.html") == 8


def test_the_page_of_sensitivity(run: Run, cell: Path, path: Path, tmp_path: Path) -> None:
    page = tmp_path / "s.html"
    of_robot = ["sensitivity", "--robot", IRB6660, "--count", "20", "--report", page]
    ended = run(*of_robot, "--task", cell / "task.toml", "--json")
    assert (ended.status, ended.json["report"]) == (0, str(page))
    assert figures(page) == 4
    first = ended.json["parameters"][0]
    assert 0.0 < first["rms_x"] <= first["max_x"]
    assert run(*of_robot, "--task", path).status == 0
    assert figures(page) == 3
    assert run(*of_robot, "--campaign", cell / "one.csv").status == 0
    assert figures(page) == 2
    (tmp_path / "path.csv").write_text(PATH[: PATH.index("\n", 100) + 1])
    assert run(*of_robot, "--task", path).status == 0  # a short path too: the poses to measure are assumed around it
    assert figures(page) == 3


def test_the_page_of_a_selection(run: Run, cell: Path, path: Path, tmp_path: Path) -> None:
    page = tmp_path / "s.html"
    of_robot = ["select", "--robot", IRB6660, "--report", page]
    ended = run(*of_robot, "--task", cell / "task.toml", "--accuracy-mm", "0.1", "--json")
    assert (ended.status, ended.json["report"]) == (0, str(page))
    assert figures(page) == 4
    text = page.read_text(encoding="utf-8")
    for part in ("dropped parameters", "published set", "identifiable set", "accuracy asked for"):
        assert part in text
    assert run(*of_robot, "--task", path).status == 0
    assert figures(page) == 3


def test_what_cannot_be_reported(run: Run, cell: Path, tmp_path: Path) -> None:
    (tmp_path / "far.toml").write_text((cell / "task.toml").read_text().replace("1711.0", "8711.0"))
    page = tmp_path / "r.html"
    for arguments, said in (
        ([cell / "one.csv", "-o", page], "is not JSON, and no calibration"),
        ([cell / "nowhere.json", "-o", page], "cannot be read"),
        ([cell / "cal.json", "--task", tmp_path / "far.toml", "-o", page], "x 8711"),
        ([cell / "cal.json", "-o", cell / "cal.json"], "would overwrite"),
        ([cell / "cal.json", "-o", tmp_path / "no" / "r.html"], "there is no folder"),
    ):
        ended = run("report", *arguments, "--json")
        assert (ended.status, ended.out) == (1, "")
        assert said in ended.err
    assert not page.exists()
    assert run("report").status == 2


@pytest.mark.parametrize("command", ["sensitivity", "select", "plan", "study"])
def test_every_page_has_a_head_and_a_summary_if_asked_for(
    run: Run, path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.setattr("taskcal.planning.study.POOL_POSES", 100)
    (tmp_path / "head.toml").write_text('customer = "Example & Sons"\n')
    beside = ["--header", tmp_path / "head.toml"]
    most = {
        "plan": ["-n", 16, "--candidates", 40, "-o", tmp_path / "p.csv"],
        "study": ["--robots", 1, "--counts", 16, "--engine", "sequential"],
    }
    given = [command, "--robot", IRB6660, "--task", path, *most.get(command, []), *beside]
    alone = run(*given)
    assert alone.status == 2
    assert "--header requires --report" in alone.err
    page = tmp_path / "s.html"
    ended = run(*given, "--report", page)
    assert ended.status == 0, ended.err
    assert str(page) in ended.out
    assert "Example &amp; Sons" in page.read_text(encoding="utf-8")
    (tmp_path / "head.toml").write_text("customer = 3\n")
    wrong = run(*given, "--report", page)
    assert wrong.status == 1
    assert "head.toml" in wrong.err


def test_a_certificate_has_what_is_known_and_lines_for_the_rest(run: Run, cell: Path, tmp_path: Path) -> None:
    """One sheet without figures, whose verdict is that of the report; fields of the head that are missing are blank."""
    head, task, sheet = tmp_path / "head.toml", cell / "task.toml", tmp_path / "certificate.html"
    head.write_text('serial_number = "6660-1"\n')
    files = ("-o", tmp_path / "r.html", "--certificate", sheet, "--header", head)
    ended = run("report", cell / "cal.json", "--task", task, *files, "--json")
    assert ended.status == 0
    text = sheet.read_text(encoding="utf-8")
    assert len(text) < 30_000
    assert "6660-1" in text
    for blank in ("operator", "instrument", "date"):
        assert f"<dt>{blank}</dt><dd>…" in text
    held = (
        "number",
        "box of",
        "joint ranges",
        "1σ = 0.5 MPE",
        sha256((cell / "cal.json").read_bytes()).hexdigest()[:16],
    )
    assert [one for one in held if one not in text] == []
    for judgement in ended.json["verdict"]["judgements"]:
        expected = judgement["expected_mm"]
        assert expected is None or f"{expected:.3f}" in text
        assert judgement["decision"] in text
