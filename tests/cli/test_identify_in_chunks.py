from pathlib import Path

import numpy as np
import pytest

import taskcal as tc
from taskcal.cli.commands import identify as identify_in_chunks
from tests.cli.conftest import Run
from tests.laws.fleets import small_model


@pytest.fixture
def large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(identify_in_chunks, "WHOLE_ROWS", 100)
    monkeypatch.setattr("taskcal.reading.chunked.PART_ROWS", 50)
    monkeypatch.setattr("taskcal.reading.chunked.SAMPLE_ROWS", 60)
    rng = np.random.default_rng(0)
    q = rng.uniform(*0.5 * small_model().robot.limits.T, size=(120, 6))
    campaign, _ = tc.simulate(small_model(), q, rng=rng)
    tc.write_campaign(tmp_path / "large.parquet", campaign, small_model().robot)
    return tmp_path / "large.parquet"


def test_large_parquet_file_is_fitted_in_chunks_and_reported(run: Run, large: Path, tmp_path: Path) -> None:
    """A large Parquet file is fitted in chunks, with a message."""
    ask = ["identify", "--robot", "abb-irb120", large, "-o", tmp_path / "cal.json"]
    ended = run(*ask, "--json")
    assert ended.status == 0, ended.err
    assert "fitted in parts: estimate and covariance are of 120 rows" in ended.err
    assert (ended.json["rows"], ended.json["fitted"]["n"], ended.json["held_out_from_sample"]["n"]) == (120, 120, 60)
    assert ended.json["fitted"]["mean_mm"] < 0.1 < ended.json["nominal_of_sample"]["mean_mm"]
    assert tc.load_calibration(tmp_path / "cal.json").provenance.rows == 120
    judged = run("validate", tmp_path / "cal.json", large, "--json").json
    for error in ("mean_mm", "rms_mm", "max_mm"):
        assert ended.json["fitted"][error] == pytest.approx(judged[error], rel=1e-6)
    shown = run(*ask, "--parameters")
    assert f"{ended.json['fitted']['mean_mm']:.3f} mm calibrated (120 fitted points)" in " ".join(shown.out.split())


@pytest.mark.parametrize(
    "options",
    [["--holdout", "0.3"], ["--effects", "auto"], ["--rows", "0:9"], ["--gross-errors", "keep"], ["--drift", "ignore"]],
)
def test_what_needs_all_rows_is_refused(run: Run, large: Path, tmp_path: Path, options: list[str]) -> None:
    ended = run("identify", "--robot", "abb-irb120", large, "-o", tmp_path / "cal.json", *options)
    assert (ended.status, ended.out) == (2, "")
    assert options[0] in ended.err
    assert "is fitted in parts" in " ".join(ended.err.split())
    assert not (tmp_path / "cal.json").exists()


def test_a_smaller_one_is_fitted_whole(run: Run, large: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(identify_in_chunks, "WHOLE_ROWS", 120)
    ended = run("identify", "--robot", "abb-irb120", large, "-o", tmp_path / "cal.json", "--holdout", "0.3", "--json")
    assert ended.status == 0, ended.err
    assert ended.json["held_out"]["n"] > 0
