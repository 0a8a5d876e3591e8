"""The doctor's advice, taken at its word, gives the campaign that it has mended, and that is the sound one."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.diagnosis.drift import find_large_move, found_local, ordered_rows
from taskcal.diagnosis.fits import fit_linearly
from taskcal.diagnosis.hypotheses import Case, hypotheses_of
from taskcal.diagnosis.rows import RowFault, find_row_fault, find_swapped
from taskcal.estimation.ordered_rows import find_event
from taskcal.geometry import se3
from taskcal.robot.catalogue import load_robot
from tests.diagnosis.mistakes import moved_station, paired
from tests.diagnosis.virtual_campaigns import virtual
from tests.laws.campaigns import random_pose

METRES = {"millimetres": 1e-3, "metres": 1.0, "inches": 0.0254, "centimetres": 0.01, "feet": 0.3048}


def as_told(fix, columns, robot):
    """Columns of a file, by name, after what a line of advice says of them."""
    out = dict(columns)
    turning = [name for name, slides in zip(robot.joint_names, robot.prismatic, strict=True) if not slides]
    if found := re.match(r"the columns (.+) hold (.+): rename", fix):
        named, held = (part.split(", ") for part in found.groups())
        out |= {is_: columns[was] for was, is_ in zip(named, held, strict=True)}
    elif found := re.match(r"reverse the sign of (\w+) ", fix):
        out[found[1]] = -columns[found[1]]
    elif found := re.match(r"add (-?[\d.]+)° to (\w+) ", fix):
        out[found[2]] = columns[found[2]] + np.radians(float(found[1]))
    elif found := re.search(r"write (\w+) ([+-]) (\w+) for (\w+) in", fix):
        out[found[4]] = columns[found[1]] + float(f"{found[2]}1") * columns[found[3]]
    elif "they hold radians" in fix:  # degrees were made radians, once too often
        out |= {name: np.degrees(columns[name]) for name in turning}
    elif found := re.search(r"multiply their columns by ([\d.e+-]+)", fix):
        out |= {name: float(found[1]) * columns[name] for name in turning}
    else:
        assert "they hold degrees" in fix
        out |= {name: np.radians(columns[name]) for name in turning}
    return out


@pytest.mark.parametrize("name", ["ur5", "barrett-wam", "denso-hsr065a1"])
@pytest.mark.parametrize("factor", [1.0, np.pi / 180.0, 180.0 / np.pi])
def test_advice_on_joints_does_what_mends_the_campaign(name, factor):
    robot, sound = load_robot(name), virtual(name, rows=12)
    turning = ~np.array(robot.prismatic)
    case = Case.of(robot, replace(sound, q=np.where(turning, factor, 1.0) * sound.q))
    columns = dict(zip(robot.joint_names, case.campaign.q.T, strict=True))
    tried = list(hypotheses_of(case, "joints"))
    expected = {"joint-sign", "joint-zero", "joint-order"} | ({"joints-in-radians"} if factor != 1.0 else set())
    expected |= {one.id for one in tried} & {"joints-in-other-unit"}  # of gon or turns by their size alone
    assert {one.id for one in tried} == expected | ({"coupling"} if (turning[1:-1] & turning[2:]).any() else set())
    for one in tried:
        told = as_told(one.fix, columns, robot)
        tolerance = {"rtol": 1e-5} if one.id == "joints-in-other-unit" else {"atol": 1e-9}  # a factor of six digits
        np.testing.assert_allclose(one.undo(case).campaign.q, np.stack([*told.values()], axis=1), **tolerance)
        changed = {name for name in columns if np.abs(told[name] - columns[name]).max() > 1e-9}
        assert changed <= set(one.subject) if one.id != "coupling" else changed == {one.subject[1]}


@pytest.mark.parametrize("factor", [1e-3, 1e3, 1.0 / 25.4, 0.0254])
def test_advice_on_units_of_points_does_what_mends_them(factor):
    case = Case.of(load_robot("ur5"), replace(virtual("ur5", targets=2, rows=12)))
    wrong = replace(case, campaign=replace(case.campaign, points=factor * case.campaign.points))
    tried = [one for one in hypotheses_of(wrong, "frames") if one.id.startswith("points-in-")]
    assert tried
    for one in tried:
        if found := re.search(r"are in (\w+), not (\w+): .* multiply them by ([\d.e+-]+)", one.fix):
            told = METRES[found[1]] / METRES[found[2]]
            assert float(found[3]) == pytest.approx(told, rel=1e-5)
        else:
            told = 1e3 if "they hold metres" in one.fix else 1e-3
        np.testing.assert_allclose(one.undo(wrong).campaign.points, told * wrong.campaign.points, rtol=1e-12)
        assert one.size == pytest.approx(told)


def test_advice_on_poses_does_what_mends_them():
    """Quaternions by the names of their columns, inverses by SciPy, a left-handed frame by what two mirrors leave."""
    case = Case.of(load_robot("ur5"), virtual("ur5", rows=12, pose=True))
    campaign = case.campaign
    names = ("qx", "qy", "qz", "qw")
    as_read = Rotation.from_matrix(campaign.rotations)
    columns = dict(zip(names, as_read.as_quat().T, strict=True))
    seen = set()
    for one in hypotheses_of(case, "frames"):
        mended = one.undo(case).campaign
        seen.add((one.id, one.cost))
        if one.id == "quaternion-order":
            held = re.search(r"hold ((?:q\w ?){4})", one.fix)[1].split()
            named = {is_: columns[was] for was, is_ in zip(names, held, strict=True)}
            expected, points = Rotation.from_quat(np.stack([named[n] for n in names], axis=1)), campaign.points
        elif "rotations (reverse" in one.fix:
            expected, points = as_read.inv(), campaign.points
        elif one.id == "inverse-poses":
            expected = as_read.inv()
            points = -expected.apply(campaign.points[:, 0])[:, None]
        else:
            points = campaign.points[..., [1, 0, 2]]
            axis = as_read.as_rotvec()
            mirrored = -axis[:, [1, 0, 2]]  # a mirror turns the sense of a rotation about its mirrored axis
            expected = as_read if "the rotations are not" in one.fix else Rotation.from_rotvec(mirrored)
        np.testing.assert_allclose(mended.points, points, atol=1e-12)
        np.testing.assert_allclose(mended.rotations, expected.as_matrix(), atol=1e-9)
    assert len(seen) == 5
    points_alone = hypotheses_of(replace(case, campaign=replace(campaign, rotations=None)), "frames")
    assert [one.id for one in points_alone] == ["left-handed"]


def test_advice_on_shifted_rows_does_what_mends_them():
    case = Case.of(load_robot("ur5"), virtual("ur5", rows=20))
    for one in hypotheses_of(case, "order"):
        found = re.search(
            r"the points stand (\d+) rows? (below|above) their joints: move .* (up|down) by (\d+) row", one.fix
        )
        up = int(found[4]) * (1 if found[3] == "up" else -1)
        assert (found[1], found[2] == "below") == (found[4], found[3] == "up")
        mended, points = one.undo(case).campaign.points, case.campaign.points
        rows = [i for i in range(20) if 0 <= i + up < 20]
        np.testing.assert_array_equal(mended[rows], points[[i + up for i in rows]])
        assert np.isnan(np.delete(mended, rows, axis=0)).all()


def parts_told(fix, rows):
    """Rows of the two parts that ``--rows FIRST:AFTER`` choose."""
    return [np.arange(rows)[int(a) : int(b)] for a, b in re.findall(r"--rows (\d+):(\d+)", fix)]


def happened(case):
    """What happened in the course of a campaign, its finding, and the campaign without it."""
    fit = fit_linearly(case, np.arange(len(case.campaign)))
    event = find_event(ordered_rows(case, fit))
    return event, found_local(event, case, fit)


@pytest.mark.parametrize("pose", [False, True])
def test_a_move_of_the_station_is_taken_back(pose):
    """From the cut on the measurements are carried into the first station's frame, where the sound ones were."""
    case = Case.of(load_robot("ur5"), virtual("ur5", rows=40, error=0.0, pose=pose))
    for cut, mm, degrees in ((17, 2.0, 0.05), (25, -5.0, -0.1)):
        wrong = moved_station(case.campaign, np.arange(40) >= cut, mm, degrees)
        found, (finding, mended) = happened(replace(case, campaign=wrong))
        ((subject,), fix) = finding.subject, finding.fix
        late = np.arange(40) >= cut
        moved = np.linalg.norm(wrong.points - case.campaign.points, axis=2)[late]
        assert subject == wrong.ids[cut]
        assert found.displacement == pytest.approx(np.median(moved), rel=0.1)
        assert float(re.search(r"about ([\d.]+) mm", fix)[1]) == pytest.approx(1e3 * found.displacement, abs=0.06)
        assert np.abs(mended.points - case.campaign.points).max() < 0.15 * moved.max()
        np.testing.assert_array_equal(mended.stations.of, late)
        if pose:
            turned = np.swapaxes(mended.rotations, 1, 2) @ case.campaign.rotations
            assert np.linalg.norm(se3.log(turned), axis=1).max() < 0.3 * np.radians(abs(degrees))


@pytest.mark.parametrize(("mm", "degrees", "cut"), [(400.0, 25.0, 18), (-150.0, -8.0, 27)])
def test_a_large_move_of_the_station_is_taken_back(mm, degrees, cut):
    """Too large to be linear; of a station that stayed nothing is said."""
    case = Case.of(load_robot("ur5"), virtual("ur5", rows=40, targets=2, error=0.0))
    late, sound = np.arange(40) >= cut, case.campaign.points
    wrong = moved_station(case.campaign, late, mm, degrees)
    finding, mended = find_large_move(replace(case, campaign=wrong))
    assert finding.subject == (wrong.ids[cut],)
    moved = np.linalg.norm(wrong.points - sound, axis=2)[late]
    assert float(re.search(r"about ([\d.]+) mm", finding.fix)[1]) == pytest.approx(1e3 * np.median(moved), rel=0.02)
    assert np.abs(mended.points - sound).max() < 0.05 * moved.max()
    np.testing.assert_array_equal(mended.stations.of, late)
    assert find_large_move(case) is None


def test_a_slipped_target_is_two_targets():
    sound = virtual("ur5", targets=3, rows=40, error=0.0)
    case = Case.of(load_robot("ur5"), sound)
    T = case.poses(np.arange(40))
    base = random_pose(np.random.default_rng(1), 2.0)[:3, :3]
    by = np.array([2e-3, -1e-3, 3e-3])
    ends = T[:, None, :3, 3] + np.einsum(
        "nij,tj->nti", T[:, :3, :3], np.array([[0.05, 0.02, 0.1], [-0.04, 0.06, 0.08], [0.03, -0.07, 0.12]])
    )
    ends[26:, 1] += T[26:, :3, :3] @ by
    wrong = replace(sound, points=ends @ base.T, uncertainty=np.full((40, 3), 1e-5) * np.array([1.0, 2.0, 3.0]))
    found, (finding, mended) = happened(replace(case, campaign=wrong))
    names, fix = finding.subject, finding.fix
    assert names == (wrong.targets[1],)
    assert found.displacement == pytest.approx(np.linalg.norm(by), rel=0.1)
    assert f"slipped by {1e3 * found.displacement:.1f} mm" in fix
    before, after = parts_told(fix, 40)
    np.testing.assert_array_equal([before[-1] + 1, after[0], after[-1]], [26, 26, 39])
    assert mended.targets == (*wrong.targets, f"{names[0]}_slipped")
    np.testing.assert_array_equal(mended.points[:26, :3], wrong.points[:26])
    np.testing.assert_array_equal(mended.points[26:, [0, 2, 3]], wrong.points[26:, [0, 2, 1]])
    assert np.isnan(mended.points[26:, 1]).all()
    assert np.isnan(mended.points[:26, 3]).all()
    np.testing.assert_array_equal(mended.uncertainty[:, 3], wrong.uncertainty[:, 1])


def test_the_drift_that_is_told_is_that_of_the_first_to_the_last_row():
    sound = virtual("ur5", rows=60, error=0.0)
    grown = np.linspace(0.0, 1.0, 60)[:, None, None] * np.array([3e-3, -3e-3, 2e-3])
    wrong = replace(sound, points=sound.points + grown)
    found, _ = happened(Case.of(load_robot("ur5"), wrong))
    assert found.displacement == pytest.approx(np.linalg.norm(grown[-1]), rel=0.15)
    assert found.after < 0.3 * found.before


def test_rows_that_were_mixed_up_are_put_back():
    sound = virtual("ur5", rows=40, error=0.0)
    rows = np.array([3, 9, 17, 30])
    order = np.arange(40)
    order[rows] = np.roll(rows, 1)  # a cycle: its inverse is another order
    wrong = Case.of(load_robot("ur5"), paired(sound, order))
    found = find_row_fault(wrong, fit_linearly(wrong, np.arange(40)))
    finding, mended = found.local(wrong.campaign)
    assert (finding.id, finding.subject) == ("rows-shuffled", tuple(sound.ids[i] for i in rows))
    np.testing.assert_array_equal(mended.points, sound.points)


def test_gross_rows_are_left_out_and_no_others():
    sound = virtual("ur5", rows=40, targets=2, error=0.0)
    points = sound.points.copy()
    points[[4, 21]] += 0.04
    points[33, 1] -= 0.04
    wrong = Case.of(load_robot("ur5"), replace(sound, points=points))
    finding, mended = find_row_fault(wrong, fit_linearly(wrong, np.arange(40))).local(wrong.campaign)
    assert (finding.id, finding.subject) == ("gross-rows", ("4", "21", "33"))
    assert mended.ids == tuple(name for name in sound.ids if name not in finding.subject)
    assert finding.error_before == pytest.approx(0.04 * np.sqrt(3.0), rel=0.4)
    assert finding.confidence == pytest.approx(1.0 - finding.error_after / finding.error_before, abs=0.01)


def test_a_fault_is_the_surer_the_less_it_leaves():
    """What it leaves of the error is what speaks against it; where it leaves all, nothing speaks for it."""
    campaign = virtual("ur5", rows=12)

    def confidence(after):
        fault = RowFault(
            id="gross-rows", rows=np.array([2]), fix="leave {rows} out", mended=campaign, before=1e-3, after=after
        )
        return fault.local(campaign)[0].confidence

    assert [confidence(after) for after in (5e-4, 2e-4)] == pytest.approx([0.5, 0.8])
    assert confidence(1e-3) == confidence(5e-3) == 0.0
    assert 0.8 < confidence(0.0) < 1.0


def test_targets_that_changed_places_change_them_back():
    sound = virtual("ur5", rows=40, targets=3, error=0.0)
    points = sound.points.copy()
    points[30:] = points[30:][:, [0, 2, 1]]
    found = find_swapped(Case.of(load_robot("ur5"), replace(sound, points=points)))
    finding, mended = found.local(sound)
    assert (finding.subject, list(found.rows)) == (sound.targets[1:], list(range(30, 40)))
    np.testing.assert_array_equal(mended.points, sound.points)


def test_a_sound_campaign_has_no_wrong_rows_however_exact():
    """Next to nothing is left of it, and a row that is off by several times that is not wrong."""
    case = Case.of(load_robot("ur5"), virtual("ur5", rows=40, targets=2, error=0.0))
    exact = replace(
        case, campaign=replace(case.campaign, points=case.poses(np.arange(40))[:, None, :3, 3].repeat(2, axis=1))
    )
    assert find_row_fault(exact, fit_linearly(exact, np.arange(40))) is None
    points = exact.campaign.points.copy()
    points[7] += 2e-4
    little = replace(exact, campaign=replace(exact.campaign, points=points))
    assert find_row_fault(little, fit_linearly(little, np.arange(40))) is None
    assert find_swapped(exact) is None
