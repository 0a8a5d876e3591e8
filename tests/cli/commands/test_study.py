"""taskcal study."""

from pathlib import Path

import pytest

from taskcal.tables.forms import read_csv
from tests.cli.conftest import IRB6660, Run
from tests.laws.cluster import cluster


@pytest.fixture
def ask(cell: Path, monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """A small study in this process, whose random plans are drawn from few poses."""
    monkeypatch.setattr("taskcal.planning.study.POOL_POSES", 100)
    small = ["--robots", "3", "--counts", "10,14", "--plans", "random,grid", "--engine", "sequential"]
    return ["study", "--robot", IRB6660, "--task", cell / "list.toml", *small]


def test_more_poses_make_the_task_more_accurate(run: Run, ask: list[object], tmp_path: Path) -> None:
    outputs = ["-o", tmp_path / "rows.csv", "--report", tmp_path / "study.html"]
    ended = run(*ask, *outputs, "--model-error-mm", "0", "--json")
    assert ended.status == 0
    result = ended.json
    assert [(line["plan"], line["count"]) for line in result["summary"]] == [
        ("random", 10), ("grid", 10), ("random", 14), ("grid", 14),
    ]  # fmt: skip
    by_case = {(line["plan"], line["count"]): line for line in result["summary"]}
    assert by_case["random", 14]["median_mm"] < by_case["random", 10]["median_mm"] < 0.3
    assert all(line["p05_mm"] <= line["median_mm"] <= line["p95_mm"] for line in result["summary"])
    assert all(0.0 <= line["share_accurate"] <= 1.0 for line in result["summary"])
    rows = read_csv(tmp_path / "rows.csv")
    assert len(rows) == 3 * 4
    assert rows.header == (
        "robot",
        "plan",
        "count",
        "model",
        "rms_mm",
        "max_mm",
        "rms_with_model_error_mm",
        "observe",
        "learnt",
        "failed",
    )
    assert (result["model_error_mm"], result["model_error_origin"]) == (0.0, "as given")
    page = (tmp_path / "study.html").read_text(encoding="utf-8")
    assert page.count("<figure>") == 1
    assert "<dt>model error</dt><dd>0 mm per axis at every pose: as given</dd>" in page


def test_an_interrupted_study_goes_on_with_the_same_result(
    run: Run, ask: list[object], cell: Path, tmp_path: Path
) -> None:
    """In threads, too; and a file of another study is refused and left as it is."""
    path = tmp_path / "study.json"
    small = [*ask, "--counts", "10", "--json"]
    whole = run(*small).json
    assert run(*small, "--resume", path, "--robots", "2").status == 0
    assert run(*small, "--resume", path, "--engine", "threading", "--workers", "2").json == whole
    before = path.read_bytes()
    ended = run(*small, "--seed", "5", "--resume", path)
    assert (ended.status, ended.out) == (1, "")
    assert f"{path}: holds a study of other settings" in ended.err
    assert path.read_bytes() == before
    ended = run(*small, "--resume", cell / "one.csv")
    assert (ended.status, ended.out) == (1, "")
    assert "does not hold a study" in ended.err


def test_every_model_in_a_table_for_people(run: Run, ask: list[object]) -> None:
    models = "all,selected,published,published-damped"
    ended = run(*ask, "--robots", "1", "--counts", "12", "--plans", "random", "--models", models)
    assert ended.status == 0
    for part in ("published-damped", "selected", "median", "within", "seed 0", "0.05 mm per axis"):
        assert part in ended.out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--engine", "ray"], "'ray' is not an engine; choose loky, threading, sequential, or dask with --scheduler"),
        (["--engine", "dask"], "such as tcp://HOST:8786"),
        (["--scheduler", "tcp://a:1"], "only --engine dask has one, not sequential"),
        (["--engine", "dask:tcp://a:1", "--scheduler", "tcp://a:1"], "only --engine dask has one"),
        (["--plans", "plannd"], "planned"),
        (["--models", "al"], "'all'"),
        (["--counts", "10,x"], "'x' is not a number"),
        (["--counts", "10,10"], "twice"),
        (["--counts", "0"], "'0' is not a number"),
        (["--robots", "0"], "--robots"),
        (["--workers", "0"], "--workers"),
        (["-o", "same", "--report", "same"], "one file"),
    ],
)
def test_wrong_usage(run: Run, ask: list[object], options: list[str], said: str) -> None:
    ended = run(*ask, *options)
    assert (ended.status, ended.out) == (2, "")
    assert said in " ".join(ended.err.replace("│", " ").split())


def test_what_cannot_be_studied(run: Run, ask: list[object], cell: Path, tmp_path: Path) -> None:
    (tmp_path / "far.toml").write_text((cell / "task.toml").read_text().replace("1711.0", "8711.0"))
    (tmp_path / "none.toml").write_text('name = "nothing"\n')
    for options, said in (
        (["--counts", "2"], "2 measured points in 2 rows are too few"),
        (["--counts", "2", "--plans", "planned"], "2 poses are too few"),
        (["--task", tmp_path / "far.toml"], "x 8711"),
        (["--task", tmp_path / "none.toml"], "exactly one of workspace, poses, path"),
        (["--task", tmp_path / "nowhere.toml"], "cannot be read"),
        (["--resume", tmp_path / "no" / "study.json"], "there is no folder"),
    ):
        ended = run(*ask, *options, "--json")
        assert (ended.status, ended.out) == (1, ""), options
        assert said in ended.err


@pytest.mark.long
def test_a_cluster_of_other_processes_gives_the_same_rows(run: Run, ask: list[object], tmp_path: Path) -> None:
    small = [*ask, "--robots", "2", "--counts", "3,10", "--plans", "random"]  # three poses cannot be fitted
    assert run(*small, "-o", tmp_path / "serial.csv").status == 0
    with cluster(tmp_path) as started:
        there = ["--engine", "dask", "--scheduler", started.address]
        ended = run(*small, *there, "-o", tmp_path / "cluster.csv")
    assert ended.status == 0, ended.err
    assert (tmp_path / "cluster.csv").read_bytes() == (tmp_path / "serial.csv").read_bytes()


def test_a_calibration_stands_for_the_robot(run: Run, ask: list[object], cell: Path, tmp_path: Path) -> None:
    other = [word for word in ask if word not in ("--robot", IRB6660)]
    ended = run(
        *other, "--calibration", cell / "cal.json", "--robots", "1", "--counts", "30", "--models", "all,geometry"
    )
    assert ended.status == 0, ended.err
    assert "with defects of the sizes that the calibration found" in " ".join(ended.out.split())
    both = run(*ask, "--calibration", cell / "cal.json")
    assert both.status == 2
    assert "give one of them" in both.err


def test_ways_to_measure_stand_in_one_table(run: Run, ask: list[object], cell: Path, tmp_path: Path) -> None:
    small = ["--robots", 2, "--counts", 36, "--engine", "sequential", "--observe", "tracker,socket,tracker+camera"]
    of = ["study", "--robot", IRB6660, "--task", cell / "task.toml", *small, "--model-error-mm", "0.1"]
    ended = run(*of, "--report", tmp_path / "study.html", "-o", tmp_path / "rows.csv", "--json")
    assert ended.status == 0, ended.err
    assert [line["observe"] for line in ended.json["summary"]] == ["tracker", "socket", "tracker+camera"]
    assert {line["plan"] for line in ended.json["summary"]} == {"random"}
    assert all(line["median_mm"] < ended.json["before_mm"]["median"] for line in ended.json["summary"])
    page = (tmp_path / "study.html").read_text(encoding="utf-8")
    assert "after teaching work frame and TCP with the calibrated robot" in page
    shown = run(*of)
    assert shown.status == 0
    assert "measured by" in shown.out
    assert "nominal, frames taught" in shown.out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--observe", "sokcet"], "did you mean 'socket'"),
        (["--observe", "socket", "--plans", "planned"], "a study plans for a tracker alone"),
    ],
)
def test_ways_that_cannot_be_studied(run: Run, cell: Path, options: list[str], said: str) -> None:
    ended = run("study", "--robot", IRB6660, "--task", cell / "task.toml", "--robots", 1, *options)
    assert ended.status in (1, 2)
    assert said in ended.err
