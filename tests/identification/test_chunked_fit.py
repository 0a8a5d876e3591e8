import numpy as np
import pytest

import taskcal as tc
from taskcal.errors import FileError
from taskcal.identification.chunked_fit import identify_in_chunks
from taskcal.reading import chunked as chunked_campaign
from taskcal.reading.chunked import campaign_in_chunks
from taskcal.reading.reader import read_campaign
from tests.laws.fleets import small_model

ROWS, WRONG = 1100, [770, 777]


@pytest.fixture(autouse=True)
def _small_parts(monkeypatch):
    monkeypatch.setattr(chunked_campaign, "PART_ROWS", 300)
    monkeypatch.setattr(chunked_campaign, "SAMPLE_ROWS", 100)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A campaign with two rows that cannot be right, of which the first is in the sample."""
    path = tmp_path_factory.mktemp("parquet") / "large.parquet"
    model, rng = small_model(), np.random.default_rng(0)
    q = rng.uniform(*0.5 * model.robot.limits.T, size=(ROWS, 6))
    campaign, _ = tc.simulate(model, q, rng=rng)
    campaign.points[WRONG] += 0.05
    tc.write_campaign(path, campaign, model.robot)
    return path


def test_parts_give_what_all_rows_at_once_give(file):
    model = small_model()
    with campaign_in_chunks(file, model.robot) as campaign:
        assert [first for first, _ in campaign] == [0, 300, 600, 900]
        assert len(campaign.sample) == 100
        fitted = identify_in_chunks(model, campaign)
    own = fitted.calibration
    assert own.prior_scale is not None
    whole = tc.identify(
        model, read_campaign(file, model.robot), model_error=own.model_error[0], prior_scale=own.prior_scale
    )
    assert list(fitted.left_out) == WRONG == [row.row for row in whole.left_out]
    assert [(row.row, row.line) for row in own.left_out] == [(770, 772)]
    assert np.abs((own.estimate - whole.estimate) / whole.standard_errors).max() < 1e-5
    np.testing.assert_allclose(own.standard_errors, whole.standard_errors, rtol=1e-5)
    np.testing.assert_allclose(own.T_tracker_base, whole.T_tracker_base, atol=1e-8)
    length = np.linalg.norm(whole.residuals, axis=2)[:, 0]
    assert fitted.fitted.count == ROWS - 2
    assert fitted.fitted.mean == pytest.approx(np.nanmean(length), rel=1e-4)
    assert fitted.fitted.maximum == pytest.approx(np.nanmax(length), rel=1e-2)
    assert fitted.unseen.count == ROWS - 100 - 1
    assert fitted.fitted.mean < fitted.unseen.mean < 1.5 * fitted.fitted.mean


def test_it_is_a_calibration_like_any_other(file, tmp_path):
    model = small_model()
    with campaign_in_chunks(file, model.robot) as campaign:
        own = identify_in_chunks(model, campaign).calibration
    own.save(tmp_path / "cal.json")
    again = tc.load_calibration(tmp_path / "cal.json")
    np.testing.assert_array_equal(again.z, own.z)
    assert (again.provenance.campaign, again.provenance.rows, len(again.ids)) == ("large.parquet", ROWS, 100)
    assert "fitted in parts" in again.remarks[0]
    prediction = own.predict(campaign.sample.q)[:, 0]
    right = campaign.sample.rows != WRONG[0]
    left = campaign.sample.points[:, 0] - prediction
    np.testing.assert_allclose(own.residuals[right, 0], left[right], atol=1e-12)
    assert np.isnan(own.residuals[~right]).all()


def test_what_only_all_rows_tell_is_refused(file, tmp_path):
    model, rng = small_model(), np.random.default_rng(0)
    q = rng.uniform(*0.5 * model.robot.limits.T, size=(40, 6))
    campaign, _ = tc.simulate(model, q, rng=rng)
    tc.write_campaign(tmp_path / "a.csv", campaign, model.robot)
    with pytest.raises(FileError, match="is not a Parquet file"), campaign_in_chunks(tmp_path / "a.csv", model.robot):
        pass
    for change, said in [
        (lambda text: text.replace("\n1,", "\n0,"), "read in parts, from row 0 on: a part:3"),
        (lambda text: text.replace("x_mm,y_mm,z_mm", "base1_x_mm,base1_y_mm,base1_z_mm"), "from row 0 on: a part:1"),
    ]:
        (tmp_path / "b.csv").write_text(change((tmp_path / "a.csv").read_text()))
        _packed(tmp_path / "b.csv", tmp_path / "b.parquet")
        with pytest.raises(FileError, match=said), campaign_in_chunks(tmp_path / "b.parquet", model.robot):
            pass
    with (
        campaign_in_chunks(file, model.robot) as campaign,
        pytest.raises(ValueError, match="effects are not fitted in parts"),
    ):
        identify_in_chunks(model + tc.Compliance(), campaign)


def _packed(csv, parquet):
    from taskcal.reading.writer import as_parquet

    parquet.write_bytes(as_parquet(csv.read_text()))
