"""The doctor on images: each mistake is planted in those of a simulated robot, and named."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.diagnosis.diagnose import diagnose, scope_of
from tests.observations.pictured import CORNERS, LENS, MODEL, PIXELS, take_pictures
from tests.observations.rig import two_boards, wrist_and_floor


def seen(seed: int):
    """Of robots with a camera on the wrist, and beside; they err at single poses and by their gears, too."""
    return take_pictures(seed, 16, on_wrist=seed % 2 == 0, error=5e-5, gears=1e-4)


def zoomed(pictured, by):
    """The same with the focal length of each image so many times as long."""
    factor = np.repeat(by, len(CORNERS))[:, None]
    return replace(pictured, pixel=PIXELS[2:4] + (pictured.pixel - PIXELS[2:4]) * factor)


def clean(pictured):
    return pictured.campaign()


def shifted(pictured):
    campaign = pictured.campaign().take(np.arange(1, 16))
    return replace(campaign, q=pictured.q[:15])


def in_inches(pictured):
    return resized(pictured, 1 / 25.4)


def printed_larger(pictured):
    return resized(pictured, 1 / 1.02)


def whole_board_for_a_square(pictured):
    return resized(pictured, 9.0)


def resized(pictured, by):
    campaign = pictured.campaign()
    (kind,) = campaign.observations
    (pictures,) = kind.pictures
    T = pictures.T_camera_board.copy()
    T[:, :3, 3] *= by
    pictures = replace(pictures, corner=by * pictures.corner, T_camera_board=T, _last=[])
    return replace(campaign, points=by * campaign.points, observations=(replace(kind, pictures=(pictures,)),))


def mirrored(pictured):
    return replace(pictured, pixel=pictured.pixel * [-1, 1] + [LENS.width - 1, 0]).campaign()


def moved(pictured):
    half = 8 * len(CORNERS)
    noise = 0.15 * np.random.default_rng(0).normal(size=pictured.pixel[half:].shape)
    after = pictured.moved(0.015).pixel[half:] + noise
    return replace(pictured, pixel=np.concatenate([pictured.pixel[:half], after])).campaign()


def drifting_focus(pictured):
    return zoomed(pictured, 1.0 + np.linspace(0.0, 0.02, 16)).campaign()


def autofocus(pictured):
    return zoomed(pictured, 1.0 + 0.015 * np.random.default_rng(1).normal(size=16)).campaign()


def reversed_joint(pictured):
    campaign = pictured.campaign()
    return replace(campaign, q=campaign.q * [1, 1, -1, 1, 1, 1])


MISTAKES = {
    "": clean,
    "rows-shifted": shifted,
    "square-size": in_inches,
    "square-size, of the board": whole_board_for_a_square,
    "square-size, of the print": printed_larger,
    "mirrored-images": mirrored,
    "fixture-moved": moved,
    "focus-changed": drifting_focus,
    "focus-changed, by autofocus": autofocus,
    "joint-sign": reversed_joint,
}


def named(pictured, name: str) -> tuple[list[str], list[str]]:
    found = diagnose(MISTAKES[name](pictured), MODEL.robot)
    return [finding.id for finding in found.findings if not finding.alternative], [name.split(",")[0]] if name else []


@pytest.mark.parametrize(
    "name", ["", pytest.param("rows-shifted", marks=pytest.mark.long), "fixture-moved", "square-size, of the print"]
)
def test_mistake_of_images_is_named(name):
    found, planted = named(seen(1), name)
    assert found == planted


@pytest.mark.long
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("name", MISTAKES)
def test_each_mistake_of_images_is_named_on_random_robots(name, seed):
    found, planted = named(seen(seed), name)
    assert found == planted


def test_images_follow_their_rows_into_the_mended_campaign():
    """Joints are mended in place; rows that were shifted have their own images again."""
    pictured = seen(2)
    turned = diagnose(reversed_joint(pictured), MODEL.robot).campaign
    np.testing.assert_allclose(turned.q, pictured.q, atol=1e-9)
    assert turned.observations[0].images == tuple(map(str, range(16)))
    mended = diagnose(shifted(pictured), MODEL.robot).campaign
    labels = mended.observations[0].labels(mended.read(0))
    assert labels == ["", *map(str, range(1, 15))]


def test_a_second_board_that_moved_is_named():
    """By its pictures alone, where the first is sound."""
    before, after = (two_boards(3, 30, look=0.25, by=by) for by in (0.0, 0.025))
    parts = [(one.corners[0], late) for one, late in ((before, False), (after, True))]
    rows = [np.flatnonzero((seen.image >= 15) == late) for seen, late in parts]
    both = {
        name: np.concatenate([getattr(seen, name)[own] for (seen, _), own in zip(parts, rows, strict=True)])
        for name in ("image", "id", "pixel")
    }
    board = tuple(seen.board[k] for (seen, _), own in zip(parts, rows, strict=True) for k in own)
    moved = replace(before, corners=(replace(parts[0][0], board=board, **both),))
    assert not diagnose(before.campaign(judged=False), MODEL.robot).findings
    (found,) = diagnose(moved.campaign(judged=False), MODEL.robot).findings
    assert found.id == "fixture-moved"
    assert "board side" in found.fix


def test_the_camera_whose_images_are_examined_is_named():
    """It, and the board, that are in most images: a shift may be of its images alone."""
    rig = wrist_and_floor(11)
    most = max(rig.corners, key=lambda one: len(np.unique(one.image)))
    assert f"board {most.board[0]} in those of {most.label}" in scope_of(rig.campaign(judged=False))
