"""A tracker that was moved: its stations share all but their frames."""

import json
from dataclasses import replace

import numpy as np
import pytest

import taskcal as tc
from taskcal.campaigns.campaign import join
from taskcal.campaigns.drift import compensate_drift
from taskcal.campaigns.performance import pose_repeatability
from taskcal.diagnosis.diagnose import diagnose
from taskcal.geometry import se3
from taskcal.identification.calibration import covariance_on, list_stations
from taskcal.identification.problem import problem_of
from taskcal.identification.residual_analysis import list_regressors
from taskcal.identification.validation import examine
from taskcal.reading.writer import write_campaign
from taskcal.registration.stations import join_stations
from taskcal.report.calibration import tabulate_stations
from tests.laws.cells import STRUCTURES, cell, unseen

MOVED = se3.pose(se3.exp(np.array([0.02, -0.01, 1.2])), np.array([2.0, -3.0, 0.1]))
"""Pose of a first tracker station in a second one."""


def seen_from(campaign, T):
    """What a tracker measures from elsewhere."""
    rotations = None if campaign.rotations is None else T[:3, :3] @ campaign.rotations
    nests = {name: se3.apply(T, points) for name, points in campaign.reference_points.items()}
    return replace(campaign, points=se3.apply(T, campaign.points), rotations=rotations, reference_points=nests)


def two_stations(some, first, T=MOVED):
    """The campaign of a cell with its last rows measured from a second station."""
    part = seen_from(some.campaign.take(slice(first, None)), T)
    return join_stations(some.model, [("A", some.campaign.take(slice(0, first))), ("B", part)])


def held_out_mm(some, calibration):
    q = unseen(some, 60)
    return 1e3 * float(np.linalg.norm(some.true_points(q) - calibration.predict(q), axis=2).mean())


@pytest.mark.parametrize("structure", STRUCTURES[:3])
def test_one_station_changes_nothing(structure):
    some = cell(structure)
    plain = tc.identify(some.model, some.campaign)
    named = tc.identify(some.model, join_stations(some.model, [("A", some.campaign)]))
    np.testing.assert_array_equal(named.z, plain.z)
    np.testing.assert_array_equal(named.z_covariance, plain.z_covariance)
    np.testing.assert_array_equal(named.stations["A"], plain.T_tracker_base)


@pytest.mark.parametrize("structure", ["six axes", "seven axes", "four-bar", "effects"])
def test_a_second_station_costs_no_more_than_six_numbers(structure):
    some = cell(structure, rows=60)
    whole = tc.identify(some.model, some.campaign)
    for T in (np.eye(4), MOVED):
        parted = tc.identify(some.model, two_stations(some, 40, T))
        spread = np.maximum(whole.standard_errors, 1e-9)
        assert np.abs((parted.estimate - whole.estimate) / spread).max() < 1.0
        assert (parted.standard_errors > 0.98 * whole.standard_errors).all()
        assert parted.standard_errors.mean() < 1.2 * whole.standard_errors.mean()


def test_where_the_second_station_is_does_not_matter():
    some = cell("six axes")
    here, there = (tc.identify(some.model, two_stations(some, 30, T)) for T in (np.eye(4), MOVED))
    np.testing.assert_allclose(there.estimate, here.estimate, atol=1e-3 * here.standard_errors.min())
    np.testing.assert_allclose(there.stations["B"], MOVED @ here.stations["B"], atol=1e-7)


def normalised_square(calibration, true, station):
    """Square of a frame's error over its stated standard deviations: chi square of six degrees of freedom."""
    layout, columns = calibration.layout, calibration.layout.bases[station].columns
    carried = layout.stations.T_first_station[station] @ true
    E = se3.inverse(layout.registration.T_tracker_base) @ carried
    e = calibration.z[columns] - np.concatenate([E[:3, 3], se3.log(E[None, :3, :3])[0]])
    return e @ np.linalg.solve(calibration.z_covariance[np.ix_(columns, columns)], e)


@pytest.mark.parametrize("robots", [4, pytest.param(40, marks=pytest.mark.long)])
def test_frames_are_found_within_their_standard_errors(robots):
    squares = []
    for seed in range(robots):
        some = cell("six axes", seed, rows=45)
        found = tc.identify(some.model, two_stations(some, 25))
        frames = (some.truth.T_tracker_base, MOVED @ some.truth.T_tracker_base)
        squares += [normalised_square(found, T, k) for k, T in enumerate(frames)]
    # mean of as many chi squares of 6 degrees of freedom, variance 12; the two of a robot err together
    assert abs(np.mean(squares) - 6.0) < 4.0 * np.sqrt(12.0 / robots)


@pytest.mark.parametrize("robots", [4, pytest.param(40, marks=pytest.mark.long)])
def test_two_stations_are_not_worse_than_the_better_one_alone(robots):
    gain = []
    for seed in range(robots):
        some = cell("six axes", 100 + seed, rows=50)
        first, second = some.campaign.take(slice(0, 30)), some.campaign.take(slice(30, 50))
        better = min(held_out_mm(some, tc.identify(some.model, part)) for part in (first, second))
        gain.append(better / held_out_mm(some, tc.identify(some.model, two_stations(some, 30))))
    # the better of two is chosen with the truth in hand, so that single robots may lose by chance
    assert np.exp(np.mean(np.log(gain))) > 1.0
    assert min(gain) > 0.6


def test_a_station_of_few_rows_and_of_one_target_of_two_counts():
    some = cell("six axes", rows=40)
    second = seen_from(some.campaign.take(slice(34, None)), MOVED).of_targets([some.campaign.targets[1]])
    joined = join_stations(some.model, [("A", some.campaign.take(slice(0, 34))), ("B", second)])
    assert joined.targets == some.campaign.targets
    assert np.isnan(joined.points[34:, 0]).all()
    found = tc.identify(some.model, joined)
    assert held_out_mm(some, found) < 0.1
    np.testing.assert_allclose(found.stations["B"], MOVED @ some.truth.T_tracker_base, atol=3e-3)


def test_poses_and_lost_beams():
    robot = tc.load_robot("ur10")
    model = tc.ErrorModel(robot)
    rng = np.random.default_rng(3)
    campaign, truth = tc.simulate(model, rng.uniform(-1.5, 1.5, (40, 6)), rng=rng, pose=True)
    points = campaign.points.copy()
    points[[3, 30]] = np.nan
    campaign = replace(campaign, points=points)
    parts = [("A", campaign.take(slice(0, 25))), ("B", seen_from(campaign.take(slice(25, None)), MOVED))]
    found = tc.identify(model, join_stations(model, parts))
    whole = tc.identify(model, campaign)
    assert np.abs((found.estimate - whole.estimate) / whole.standard_errors).max() < 1.5
    np.testing.assert_allclose(found.stations["B"], MOVED @ truth.T_tracker_base, atol=3e-3)


def test_a_gross_error_at_the_second_station_is_left_out():
    some = cell("six axes", rows=40)
    points = some.campaign.points.copy()
    points[35] += 0.05
    found = tc.identify(some.model, two_stations(replace(some, campaign=replace(some.campaign, points=points)), 25))
    assert [row.row for row in found.left_out] == [35]


def test_validation_knows_stations_and_finds_others():
    some = cell("six axes", rows=60)
    fitted = two_stations(replace(some, campaign=some.campaign.take(slice(0, 40))), 20)
    calibration = tc.identify(some.model, fitted)
    rest = some.campaign.take(slice(40, None))
    here = tc.validate(calibration, rest)
    moved = seen_from(rest, MOVED)
    there = tc.validate(calibration, join_stations(some.model, [("B", moved)]))
    assert not any("station" in remark for remark in there.remarks)
    assert there.mean == pytest.approx(here.mean, rel=0.3)
    both = join_stations(some.model, [("B", moved), ("A", rest)])
    examined = examine(calibration, both)
    assert examined.inside is not None
    assert examined.inside.mean() > 0.85
    elsewhere = tc.validate(calibration, join_stations(some.model, [("C", seen_from(moved, MOVED))]))
    assert "does not know station C (20 rows)" in elsewhere.remarks[0]
    assert elsewhere.mean < 1.1 * here.mean
    assert "name no station" in here.remarks[0]


def test_the_covariance_of_a_row_is_that_of_its_station():
    some = cell("six axes", rows=40)
    joined = two_stations(some, 35)
    calibration = tc.identify(some.model, joined)
    noise = joined.covariances()
    trace = np.trace((covariance_on(calibration, joined, noise) - noise)[:, 0], axis1=1, axis2=2)
    alone = np.trace(calibration.predict_covariance(joined.q)[:, 0], axis1=1, axis2=2)
    np.testing.assert_allclose(trace[:35], alone[:35])
    assert (trace[35:] > alone[35:]).all()


def test_a_calibration_file_has_its_stations(tmp_path):
    some = cell("six axes", rows=40)
    calibration = tc.identify(some.model, two_stations(some, 25))
    calibration.save(tmp_path / "cal.json")
    again = tc.load_calibration(tmp_path / "cal.json")
    assert list(again.stations) == ["A", "B"]
    np.testing.assert_array_equal(again.stations["B"], calibration.stations["B"])
    assert list_stations(again) == list_stations(calibration)
    deviation = dict(zip(again.all_names, np.sqrt(np.diag(again.z_covariance)), strict=True))
    for station, frame in zip(list_stations(again), ("base", "station B"), strict=True):
        T = again.stations[station["name"]]
        assert station["rows"] == {"A": 25, "B": 15}[station["name"]]
        np.testing.assert_allclose(station["position_mm"], 1e3 * T[:3, 3])
        np.testing.assert_allclose(se3.from_quaternion(np.array(station["quaternion"])), T[:3, :3], atol=1e-12)
        for key, part in (("mm", "t"), ("mrad", "r")):
            expected = [1e3 * deviation[f"{frame}.{part}{axis}"] for axis in "xyz"]
            assert station[f"standard_error_{key}"] == pytest.approx(expected)
    content = json.loads((tmp_path / "cal.json").read_text())
    content["stations"]["of"][0] = 2
    (tmp_path / "cal.json").write_text(json.dumps(content))
    with pytest.raises(tc.TaskcalError, match="'stations' names 2"):
        tc.load_calibration(tmp_path / "cal.json", unsealed=True)


def test_a_virtual_tracker_goes_around_the_robot():
    model = tc.ErrorModel(tc.load_robot("ur10"))
    rng = np.random.default_rng(5)
    campaign, truth = tc.simulate(model, rng.uniform(-1.5, 1.5, (45, 6)), rng=rng, stations=3, lost=0.05)
    assert campaign.stations.rows == (15, 15, 15)
    assert campaign.ids == tuple(map(str, range(45)))
    found = tc.identify(model, campaign)
    for k, T in enumerate(found.stations.values()):
        np.testing.assert_allclose(T, truth.T_tracker_base @ se3.rotation("z", 2 * np.pi * k / 3), atol=5e-3)
    assert normalised_square(found, truth.T_tracker_base @ se3.rotation("z", 2 * np.pi / 3), 1) < 30.0
    assert len(tabulate_stations(found)) == 3
    with pytest.raises(tc.TaskcalError, match="a tracker alone"):
        tc.simulate(model, campaign.q, rng=rng, stations=2, observe="socket")


def test_the_distance_from_the_tracker_is_that_from_the_station():
    some = cell("six axes", rows=60)
    campaign = two_stations(some, 30)
    found = tc.identify(some.model, campaign)
    (distance,) = (r.values for r in list_regressors(found, campaign) if r.name == "distance from the tracker")
    for k, (name, T) in enumerate(found.stations.items()):
        rows = campaign.stations.of == k
        there = se3.apply(T @ se3.inverse(found.T_tracker_base), found.predict(campaign.q[rows])[:, 0])
        np.testing.assert_allclose(distance[rows, 0], np.linalg.norm(there, axis=1), atol=0.3, err_msg=name)


def test_poses_that_recur_at_another_station_are_not_repeated():
    some = cell("six axes", rows=30)
    parts = [("A", some.campaign), ("B", seen_from(some.campaign, MOVED))]
    with pytest.raises(tc.TaskcalError, match="recur"):
        pose_repeatability(join_stations(some.model, parts))
    again = pose_repeatability(join_stations(some.model, [*parts, ("A", some.campaign)]))
    assert len(again) == 30
    with pytest.raises(tc.TaskcalError, match="join_stations"):
        join([join_stations(some.model, parts), some.campaign])


def test_the_doctor_examines_every_station():
    some = cell("six axes", rows=60)
    joined = two_stations(some, 35)
    sound = diagnose(joined, some.model.robot)
    assert sound.findings == ()
    assert "A, B" in sound.scope
    q = joined.q.copy()
    q[35:, 2] *= -1.0
    found = diagnose(replace(joined, q=q), some.model.robot)
    assert found.findings[0].id == "joint-sign"
    assert "station 'B'" in found.scope


def with_nests(some, first, rng, count=3, sigma=8e-6):
    """Two stations that see the same reference points beside each pose."""
    base = some.truth.T_tracker_base
    places = se3.apply(base, rng.uniform(-1.5, 1.5, (count, 3)))
    n = len(some.campaign)
    nests = {f"base{p + 1}": at + sigma * rng.normal(size=(n, 3)) for p, at in enumerate(places)}
    return two_stations(replace(some, campaign=replace(some.campaign, reference_points=nests)), first)


def test_reference_points_tie_stations():
    some, rng = cell("six axes", rows=40, noise=2e-4), np.random.default_rng(0)
    plain, tied = two_stations(some, 34), with_nests(some, 34, rng)
    spread = {}
    for name, campaign in (("plain", plain), ("tied", tied)):
        found = tc.identify(some.model, campaign)
        columns = [found.layout.bases[k].columns for k in (0, 1)]
        A = np.zeros((6, len(found.z)))
        A[range(6), columns[1]], A[range(6), columns[0]] = 1.0, -1.0
        spread[name] = np.sqrt(np.diag(A @ found.z_covariance @ A.T))
        squares = [
            normalised_square(found, T, k)
            for k, T in enumerate((some.truth.T_tracker_base, MOVED @ some.truth.T_tracker_base))
        ]
        assert max(squares) < 25.0
    assert (spread["tied"] < 0.5 * spread["plain"]).all()
    # three points of 8 µm or so each over a metre leave some 10 µm and 10 µrad of a relative frame
    assert (spread["tied"] < 40e-6).all()


def test_ties_are_differentiated_rightly():
    some = cell("six axes", rows=30)
    campaign = with_nests(some, 15, np.random.default_rng(1), count=2)
    layout = tc.identify(some.model, campaign).layout
    problem = problem_of(layout, campaign, None)
    z = problem.layout.start()
    at = problem.ties.rows(layout, z)
    assert at.by_entry.shape == (12, len(z))
    for i in [*layout.bases[0].columns, *layout.bases[1].columns]:
        step = np.zeros(len(z))
        step[i] = 1e-6
        up, down = (problem.ties.rows(layout, z + sign * step).residual for sign in (1.0, -1.0))
        np.testing.assert_allclose(at.by_entry[:, i], (down - up) / 2e-6, rtol=1e-4, atol=1e-3)


def test_a_reference_point_that_was_moved_is_named():
    some = cell("six axes", rows=30)
    rng = np.random.default_rng(2)
    nests = {f"base{p}": np.tile(rng.uniform(-2, 2, 3), (30, 1)) for p in range(3)}
    nests["base1"][15:] += 1e-3
    moved = replace(some, campaign=replace(some.campaign, reference_points=nests))
    with pytest.raises(tc.TaskcalError, match=r"base1.* one of them was moved"):
        two_stations(moved, 15)


def test_drift_is_followed_station_by_station():
    some, rng = cell("six axes", rows=60), np.random.default_rng(3)
    joined = with_nests(some, 30, rng)
    drift = np.linspace(0.0, 5e-4, 60)[:, None] * np.array([1.0, 0.0, 0.0])
    nests = {name: seen + drift for name, seen in joined.reference_points.items()}
    followed = compensate_drift(replace(joined, points=joined.points + drift[:, None], reference_points=nests))
    assert followed.followed
    assert all(remark.startswith("station ") for remark in followed.remarks)
    found = tc.identify(some.model, followed.campaign)
    q = unseen(some, 60)
    true, predicted = some.true_points(q).reshape(-1, 3), found.predict(q).reshape(-1, 3)
    off = np.linalg.norm(true - se3.apply(se3.fit_points(predicted, true), predicted), axis=1)
    assert 1e3 * off.mean() < 0.03


# Files.


@pytest.fixture
def files(tmp_path):
    """A file for each station, one with a column, and the robot."""
    robot = tc.load_robot("ur10")
    model = tc.ErrorModel(robot)
    rng = np.random.default_rng(0)
    campaign, _ = tc.simulate(model, rng.uniform(-1.5, 1.5, (50, 6)), rng=rng)
    east = campaign.take(slice(0, 30))
    west = replace(seen_from(campaign.take(slice(30, None)), MOVED), ids=tuple(map(str, range(20))))
    write_campaign(tmp_path / "east.csv", east, robot)
    write_campaign(tmp_path / "west.csv", west, robot)
    write_campaign(tmp_path / "both.csv", join_stations(model, [("east", east), ("west", west)]), robot)
    return tmp_path, robot


def test_a_column_and_several_files_are_read_alike(files):
    folder, robot = files
    one = tc.read_campaign(folder / "both.csv", robot)
    several = tc.read_campaign([folder / "east.csv", folder / "west.csv"], robot)
    assert one.stations.names == several.stations.names == ("east", "west")
    np.testing.assert_allclose(one.points, several.points, atol=1e-9)
    assert "station west" in several.row(35)
    assert len(set(several.ids)) == 50


def test_rows_of_stations_in_turns_keep_the_order_of_the_file(files):
    folder, robot = files
    lines = (folder / "both.csv").read_text().splitlines()
    order = np.argsort([k % 10 for k in range(50)], kind="stable")
    (folder / "turns.csv").write_text("\n".join([lines[0], *(lines[1 + k] for k in order)]) + "\n")
    turns, plain = (tc.read_campaign(folder / name, robot) for name in ("turns.csv", "both.csv"))
    np.testing.assert_allclose(turns.q, plain.q[order])
    assert turns.lines.tolist() == list(range(2, 52))
    assert turns.row_of(4) == 4


def test_files_of_one_station_share_its_name(files):
    folder, robot = files
    for name in ("first", "second"):
        text = (folder / "west.csv").read_text().splitlines()
        rows = [f"{line},{'station' if k == 0 else 'W'}" for k, line in enumerate(text)]
        (folder / f"{name}.csv").write_text("\n".join(rows))
    campaign = tc.read_campaign([folder / "first.csv", folder / "second.csv", folder / "east.csv"], robot)
    assert campaign.stations.names == ("W", "east")
    assert campaign.stations.rows == (40, 30)


def test_what_is_wrong_with_stations_is_said(files):
    folder, robot = files
    model = tc.ErrorModel(robot)
    (folder / "more").mkdir()
    (folder / "more" / "east.csv").write_text((folder / "east.csv").read_text())
    with pytest.raises(tc.TaskcalError, match=r"is called as .*east\.csv.*column station"):
        tc.read_campaign([folder / "east.csv", folder / "more" / "east.csv"], robot)
    text = (folder / "both.csv").read_text().replace(",west,", ",,", 1)
    (folder / "empty.csv").write_text(text)
    with pytest.raises(tc.TaskcalError, match=r"empty.csv:32.*'station'.*no station"):
        tc.read_campaign(folder / "empty.csv", robot)
    joined = tc.read_campaign(folder / "both.csv", robot)
    with pytest.raises(tc.TaskcalError, match=r"east, west.*cannot be held"):
        tc.identify(model, joined, frames="fixed")
    east = tc.read_campaign(folder / "east.csv", robot)
    with pytest.raises(tc.TaskcalError, match=r"station 'B' measured 2 points.*too few"):
        join_stations(model, [("A", east), ("B", east.take([0, 1]))])
    with pytest.raises(tc.TaskcalError, match="no name"):
        join_stations(model, [("A", east), ("", east)])
    socket, _ = tc.simulate(model, east.q, rng=np.random.default_rng(0), observe="wire")
    with pytest.raises(tc.TaskcalError, match=r"observed otherwise \(distance\)"):
        join_stations(model, [("A", socket)])
