"""Several boards and cameras in one fit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import chi2

from taskcal.errors import CampaignError
from taskcal.export.camera import Pictured
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration, load_calibration
from taskcal.identification.identify import identify
from taskcal.observations import Pixels
from taskcal.observations.base import TrackerNoise
from taskcal.observations.calibration_board import Ruler
from taskcal.observations.pixels import COMPONENTS
from taskcal.reading.pictures import Corners
from tests.observations.pictured import CAMERA, LENS, MODEL
from tests.observations.rig import FLOOR, Rig, of_boards, two_boards, two_cameras, wrist_and_floor

RIGS = [two_boards, two_cameras, wrist_and_floor]


def apart(T: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Move and turn from the true pose."""
    return np.concatenate([T[:3, 3] - true[:3, 3], se3.log(T[:3, :3] @ true[:3, :3].T)])


def far_off(rig: Rig, calibration: Calibration) -> dict[str, float]:
    """Squared error of the place of each camera and board over its stated covariance, of six numbers."""
    out: dict[str, float] = {}
    pictured = Pictured.of(calibration)
    for name in pictured.kind.bodies:
        T, C = pictured.place(name)
        off = apart(T, rig.bodies[name])
        out[name] = float(off @ np.linalg.solve(C, off))
    return out


@pytest.mark.long
@pytest.mark.parametrize("make", [two_boards, wrist_and_floor])
def test_places_of_all_are_as_sure_as_stated(make, tmp_path):
    """With gears and single poses off, which the fit does not know; and saved and loaded the same."""
    rig = make(2, error=5e-5, gears=5e-5)
    campaign = rig.campaign()
    calibration = identify(MODEL, campaign)
    assert max(far_off(rig, calibration).values()) < chi2(6).ppf(0.999)
    calibration.save(tmp_path / "cal.json")
    again = load_calibration(tmp_path / "cal.json")
    np.testing.assert_allclose(again.residuals_on(campaign), calibration.residuals, atol=1e-9)


@pytest.mark.parametrize("make", [two_boards, wrist_and_floor])
def test_derivatives_of_several_are_those_of_differences(make):
    """Of poses that pictures have together, and of what they say of boards and cameras among each other; without noise."""
    rig = make(3, 6, noise=1e-9)
    campaign = rig.campaign(
        tuple(replace(board, measured=Ruler(length_mm=100.0, u_mm=0.1)) for board in rig.boards), judged=False
    )
    (kind,), measured = campaign.observations, campaign.read(0)
    T = MODEL.poses(rig.q, rig.x) @ rig.bodies[kind.moving[0]]
    unknown = kind.settle(T, measured, np.full(len(kind.unknowns), np.nan))
    assert len(kind.views(unknown).of) > 3
    at, told = kind.differentiate(T, unknown, measured), kind.views(unknown)
    steps = 2e-6 * np.eye(len(unknown))

    def differences(of):
        return np.stack([(of(unknown - h) - of(unknown + h)) / 4e-6 for h in steps], axis=2)

    by = differences(lambda u: kind.differentiate(T, u, measured).residual)
    seen = measured.valid
    np.testing.assert_allclose(at.by_unknown[seen], by[seen], atol=2e-5)
    root = np.abs(told.by_unknown).max(axis=(1, 2), keepdims=True)
    off = differences(lambda u: kind.views(u).residual)
    np.testing.assert_allclose(-told.by_unknown / root, off / root, atol=2e-4)


def test_boards_are_where_a_bundle_adjustment_has_them():
    """By SciPy on OpenCV's projection, each image with a pose of its own, to a tenth of a standard deviation: the second order."""
    cv2 = pytest.importorskip("cv2")
    rig = two_boards(5, 10)
    (kind,) = rig.campaign().observations
    (pictures,), k = kind.pictures, len(CAMERA)
    # as a fit without rows: Gauss and Newton on what is stated, the first board held
    x, free = kind.start.copy(), np.r_[6:12, 12 : 12 + k]
    for _ in range(8):
        stated = kind.stated(x)
        J = stated.by_unknown[:, free]
        x[free] += np.linalg.lstsq(J, stated.residual, rcond=None)[0]
    first, second = (se3.pose(se3.exp(x[a + 3 : a + 6]), x[a : a + 3]) for a in (0, 6))
    deviation = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))

    def residual(y):
        K, out = np.array([[y[0] * 1e3, 0, y[2] * 1e3], [0, y[1] * 1e3, y[3] * 1e3], [0, 0, 1]]), []
        between, poses = se3.pose(se3.exp(y[k + 3 : k + 6]), y[k : k + 3]), y[k + 6 :].reshape(-1, 6)
        for p, (a, b) in enumerate(zip(pictures.first[:-1], pictures.first[1:], strict=True)):
            pose = poses[pictures.view[p]]
            T = se3.pose(se3.exp(pose[3:]), pose[:3]) @ (between if pictures.board[p] else np.eye(4))
            turn, place = cv2.Rodrigues(T[:3, :3])[0], T[:3, 3]
            seen = cv2.projectPoints(pictures.corner[a:b], turn, place, K, y[4:k])[0].reshape(-1, 2)
            out.append(np.sqrt(pictures.weight[a:b, None]) * (pictures.pixel[a:b] - seen))
        return np.concatenate(out).ravel()

    among = se3.inverse(first) @ second
    settled = pictures.settle(x[12 : 12 + k]).T_camera_board
    start = np.zeros((len(kind.images), 6))
    for p, v in enumerate(pictures.view):
        T = settled[p] @ (se3.inverse(among) if pictures.board[p] else np.eye(4))
        start[v] = [*T[:3, 3], *se3.log(T[:3, :3])]
    y = np.concatenate([x[12 : 12 + k], among[:3, 3], se3.log(among[:3, :3]), start.ravel()])
    found = least_squares(residual, y, x_scale="jac", method="trf").x
    there = se3.pose(se3.exp(found[k + 3 : k + 6]), found[k : k + 3])
    assert (np.abs(first[:3, :3] @ apart(there, among)[:3]) < 0.1 * deviation[:3]).all()
    assert (np.abs(first[:3, :3] @ apart(there, among)[3:]) < 0.1 * deviation[3:6]).all()
    assert (np.abs(found[:k] - x[12 : 12 + k]) < 0.1 * deviation[6:]).all()


def true_unknowns(rig: Rig, kind: Pixels) -> np.ndarray:
    """The unknowns as they are."""
    first, out = se3.inverse(rig.bodies[kind.moving[0]]), np.zeros(len(kind.unknowns))
    for k, name in enumerate(kind.unknowns):
        body, _, last = name.rpartition(".")
        if last in LENS.unknowns:
            out[k] = rig.numbers[body.removeprefix("camera").strip()][LENS.unknowns.index(last)]
        elif last != "scale":
            T = rig.bodies[body] if body in kind.standing else first @ rig.bodies[body]
            out[k] = [*T[:3, 3], *se3.log(T[:3, :3])][COMPONENTS.index(last)]
    return out


@pytest.mark.parametrize("make", RIGS)
def test_the_order_of_boards_and_cameras_does_not_matter(make):
    """Whichever comes first, and is the target: corners tell the same of each state of robot, boards and cameras."""
    rig = make(4, 12)
    turned, costs = replace(rig, boards=rig.boards[::-1], corners=rig.corners[::-1]), []
    whole = rig.campaign()
    kind = whole.observations[0]
    last = replace(kind, moving=kind.moving[::-1]).target
    other = rig.campaign(targets=(last,))
    assert other.targets == (last,)
    for each, campaign in ((rig, whole), (turned, turned.campaign()), (rig, other)):
        (kind,), seen = campaign.observations, campaign.read(0)
        T = MODEL.poses(each.q, each.x) @ se3.error_transform(np.full(6, 3e-4)) @ each.bodies[kind.moving[0]]
        unknown = true_unknowns(each, kind)
        kind = replace(kind, start=unknown)
        at, stated = kind.differentiate(T, unknown, seen), kind.stated(unknown)
        W = np.linalg.inv(kind.covariance(seen, None, TrackerNoise()))
        r, own = at.residual[seen.valid], stated.residual / stated.uncertainty
        costs.append(np.einsum("ni,nij,nj->", r, W[seen.valid], r) + own @ own)
    assert costs == pytest.approx([costs[0]] * 3, rel=1e-2)


def test_images_of_other_cameras_than_calibrated_are_refused():
    """What is on the wrist stands there, a camera has another size, or nothing on the wrist is known."""
    rig = wrist_and_floor(4, 12)
    (kind,) = rig.campaign().observations
    numbers = np.arange(float(len(kind.unknowns)))
    fewer = replace(kind, cameras=kind.cameras[:1], lenses=kind.lenses[:1])
    assert set(fewer.named_like(kind, numbers)) < set(numbers)
    larger = replace(kind, lenses=(kind.lenses[0], replace(LENS, width=1920)))
    with pytest.raises(CampaignError, match=r"camera cell has images of 1920 × 1200 pixels"):
        larger.named_like(kind, numbers)
    swapped = replace(kind, moving=("board side", "camera cell"))
    with pytest.raises(CampaignError, match="camera wrist stands in these images, and is on the wrist in the calib"):
        swapped.named_like(kind, numbers)
    with pytest.raises(CampaignError, match=r"on the wrist, the calibration camera left: they are of other cameras"):
        rig.campaign(targets=("camera left",))


@pytest.mark.parametrize("make", [two_boards, two_cameras])
def test_two_boards_or_cameras_tell_no_less_than_one(make):
    """Hand-eye and camera are surer beside an arm whose single poses are off by 0.05 mm and 0.05 mrad."""
    rig, covariance = make(6, 14), []
    for campaign in (rig.campaign(), rig.campaign((FLOOR,), (0,))):
        (kind,), seen = campaign.observations, campaign.read(0)
        T = MODEL.poses(rig.q, rig.x) @ rig.bodies[kind.moving[0]]
        unknown = true_unknowns(rig, kind)
        at, stated = kind.differentiate(T, unknown, seen), kind.stated(unknown)
        on_tool = at.by_target @ np.kron(np.eye(2), T[:, :3, :3])
        J = np.concatenate([on_tool, at.by_unknown], axis=2)[seen.valid]
        W = np.linalg.inv(kind.covariance(seen, None, TrackerNoise())[seen.valid] + 5e-5**2 * np.eye(6))
        A = np.pad(stated.by_unknown / stated.uncertainty[:, None], ((0, 0), (6, 0)))
        C = np.linalg.inv(np.einsum("nia,nij,njb->ab", J, W, J) + A.T @ A)
        focal = 6 + kind.unknowns.index(f"{kind.cameras[0]}.fx")
        covariance.append([*np.diag(C)[:6], C[focal, focal]])
    assert (np.array(covariance[0]) < covariance[1]).all()


def unseen(rig: Rig) -> Rig:
    return replace(rig, corners=tuple(of_boards(one, ["floor"]) for one in rig.corners))


def both_stand(rig: Rig) -> Rig:
    """The camera beside the robot sees the board on the floor, too."""
    wrist, cell = rig.corners
    still = of_boards(wrist, ["floor"])
    same = still.pixel[still.image == still.image[0]]
    ids = still.id[still.image == still.image[0]]
    count = len(cell.images)
    return replace(
        rig,
        corners=(
            wrist,
            replace(
                cell,
                image=np.concatenate([cell.image, np.repeat(np.arange(count), len(ids))]),
                board=(*cell.board, *("floor",) * (count * len(ids))),
                id=np.concatenate([cell.id, np.tile(ids, count)]),
                pixel=np.concatenate([cell.pixel, np.tile(same, (count, 1))]),
            ),
        ),
    )


def renamed(rig: Rig) -> Rig:
    """The images of the camera beside the robot have names of their own."""
    wrist, cell = rig.corners
    return replace(rig, corners=(wrist, replace(cell, images=tuple(f"c{name}" for name in cell.images))))


def late(rig: Rig) -> Rig:
    """The first image of the camera beside the robot is missing, and the others are counted anew; in some it sees no board."""
    wrist, cell = rig.corners
    own = np.flatnonzero(cell.image > 0)
    part = {"image": cell.image[own] - 1, "id": cell.id[own], "pixel": cell.pixel[own]}
    return replace(rig, corners=(wrist, replace(cell, board=tuple(cell.board[k] for k in own), **part)))


def mixed(rig: Rig) -> Rig:
    """The first half of the images of two cameras are in the folder of the other."""
    left, right = rig.corners
    early, half = [one.image < len(one.images) / 2 for one in (left, right)], list[Corners]()
    for k, one in enumerate((left, right)):
        other, first, last = (left, right)[1 - k], np.flatnonzero(early[1 - k]), np.flatnonzero(~early[k])
        part = {
            key: np.concatenate([getattr(other, key)[first], getattr(one, key)[last]])
            for key in ("image", "id", "pixel")
        }
        half.append(replace(one, board=("floor",) * len(part["id"]), **part))
    return replace(rig, corners=tuple(half))


def twice(rig: Rig) -> Rig:
    """The camera beside the robot took two images."""
    wrist, cell = rig.corners
    early = np.flatnonzero(cell.image <= np.unique(cell.image)[1])
    part = {key: getattr(cell, key)[early] for key in ("image", "id", "pixel")}
    return replace(rig, corners=(wrist, replace(cell, board=tuple(cell.board[k] for k in early), **part)))


@pytest.mark.parametrize(
    ("make", "change", "words"),
    [
        (two_boards, unseen, ("board side", "no image")),
        (wrist_and_floor, twice, ("camera cell", "board side", "2 images", "none of the others")),
        (wrist_and_floor, both_stand, ("camera cell", "board floor", "both stand")),
        (wrist_and_floor, renamed, ("camera cell", "no row names", "c0000.png")),
        (wrist_and_floor, late, ("camera cell", "shifted", "the row after")),
        (two_cameras, mixed, ("board floor", "of camera", "follow the robot neither")),
    ],
)
def test_what_does_not_go_together_is_refused_by_name(make, change, words):
    rig = change(make(7, 14 if change is not mixed else 24))
    with pytest.raises(CampaignError) as refused:
        rig.campaign()
    assert all(word in str(refused.value) for word in words), refused.value
