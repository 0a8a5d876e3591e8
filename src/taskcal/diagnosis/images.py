"""Campaigns of images as those of a tracker: what moves, camera or board, is a target, and what stands is the measuring frame.

What the doctor finds is told in the words of images; beside it, the size of the board and the focus are looked at.
"""

import re
from dataclasses import dataclass, replace

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.diagnosis.fits import fit_linearly
from taskcal.diagnosis.hypotheses import Case, Finding, looked_for
from taskcal.observations import Pixels, pictures_of
from taskcal.observations.camera import Pictures
from taskcal.reading.pictures import FEWEST_SHIFTED, LOCK, BoardPoses, find_move, focus_drift, is_of_other_size
from taskcal.registration.length_scale import board_said, find_length_scale

NOT_TOLD_OF_IMAGES = ("inverse-poses",)
"""It says no more than that the camera is beside the robot, or on the wrist, after all."""

NOT_TOLD_BESIDE_FOCUS = ("drift", "points-scaled")
"""A focus that changes makes distances larger and smaller, and tells neither a drift nor the size of the board."""

NOT_MENDED_OF_IMAGES = ("square-size", "mirrored-images", "fixture-moved", "drift", "focus-changed")
"""Mistakes that no change of the rows can fix."""

MIN_DEPTH_SHARE, DEPTH_SIGMAS, MIN_DEPTH_RATIO = 2e-3, 4.0, 2.0
"""Error of distances from camera to board over them, times what the corners' noise explains, and times what is off across the line
of sight, from which on the focus is doubted. Of simulated robots 0.02 % is left, with focal lengths that scatter by 1 % 0.4 %."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SeenPoses:
    """Poses of one board in images, as a tracker would have measured them."""

    kind: Pixels
    poses: BoardPoses
    given: Campaign
    """With their images; other rows show nothing."""
    others: tuple[BoardPoses, ...]
    """Of other boards, and of other cameras."""

    @classmethod
    def of(cls, case: Case) -> "SeenPoses":
        """Of the rows in which a camera sees the board that it sees in most of them."""
        kind, campaign = pictures_of(case.campaign.observations), case.campaign
        assert kind is not None
        poses, *others = BoardPoses.each(kind, case.poses(np.arange(len(campaign))))
        return cls(kind=kind, poses=poses, given=poses.in_rows_of(campaign, kind), others=tuple(others))

    @property
    def board(self) -> str:
        """Name of the board."""
        return self.kind.boards[self.poses.board]

    @property
    def pictures(self) -> Pictures:
        """Of the board by the camera."""
        assert self.kind.pictures is not None
        own = self.kind.pictures[self.poses.camera]
        return own.take(np.flatnonzero(own.board == self.poses.board))

    @property
    def campaign(self) -> Campaign:
        """As of a tracker."""
        return replace(self.given, observations=())

    @looked_for("images", "square-size")
    def find_size(self) -> tuple[Finding, Campaign] | None:
        """Boards of another size, where the robot's motion asks for it, and the campaign with boards of that size."""
        closes = np.isfinite(self.poses.T[:, 0, 3])
        if closes.sum() < 3:
            return None
        part = self.poses._replace(T=self.poses.T[closes], mounts=tuple(M[closes] for M in self.poses.mounts))
        one = min(part.apart, key=lambda apart: apart.turn)
        if not is_of_other_size(one) or one.scale <= 0.0:
            return None
        finding = Finding(
            id="square-size",
            subject=(self.board,),
            error_before=None,
            error_after=None,
            confidence=0.95,
            fix=f"the robot moves {one.scale:.3g} times as far as the board's size says: multiply the lengths in its file by that "
            "(25.4 or 0.0394 is of inches), or state the size of one square, not of the whole board",
        )
        return finding, replace(self.campaign, points=one.scale * self.given.points)

    @looked_for("drift", "focus-changed")
    def find_focus(self, case: Case) -> Finding | None:
        """A focal length that drifts, or differs from image to image: distances are off, along the line of sight alone."""
        said, fit = focus_drift(self.pictures), fit_linearly(case, np.arange(len(case.campaign)))
        if said is None and fit is not None:
            # what moves is at its place in the frame of what stands: the line of sight, but for the place of a corner on the board
            sight = case.campaign.points[fit.rows, 0]
            length = np.linalg.norm(sight, axis=1)
            along = (fit.left * sight).sum(axis=1) / length
            across = np.sqrt(((fit.left**2).sum(axis=1) - along**2).mean() / 2.0)
            share = float(np.sqrt(((along / length) ** 2).mean()))
            least = max(MIN_DEPTH_SHARE, DEPTH_SIGMAS * self._depth_noise())
            if share > least and np.sqrt((along**2).mean()) > MIN_DEPTH_RATIO * across:
                said = f"distances from camera to board differ by {share * 100:.2f} % (1σ) from image to image, {LOCK}"
        if said is None:
            return None
        return Finding(id="focus-changed", subject=(), error_before=None, error_after=None, confidence=0.9, fix=said)

    def has_size_stated(self, case: Case) -> bool:
        """Whether what is stated of the board's size lets it be the scale of all lengths that the robot tells."""
        scale = find_length_scale(case.model, self.campaign)
        return scale is not None and not scale.differs(self.kind.u_scale[self.poses.board])

    def _depth_noise(self) -> float:
        """Standard deviation of the distance from camera to board by the noise of the corners, as a share of it."""
        settled = self.pictures.settle(self.pictures.camera)
        t = settled.T_camera_board[:, :3, 3]
        square = (t**2).sum(axis=1)
        variance = np.einsum("ni,nij,nj->n", t, settled.pose_covariance[:, :3, :3], t) / square
        return float(np.sqrt((variance / square).mean()))

    def find_in_others(self) -> list[Finding]:
        """What is wrong with other boards and cameras, each pair by itself, where joints and robot are right."""
        out: list[Finding] = []
        for pair in self.others:
            camera, board = self.kind.cameras[pair.camera], f"board {self.kind.boards[pair.board]}"
            moves = self.kind.on_wrist[pair.camera]
            if len(pair.rows) < FEWEST_SHIFTED or not np.isfinite(pair.T).all():
                continue
            one, moved = pair.apart[0 if moves else 1], find_move(pair.T, pair.mounts[0 if moves else 1])
            if is_of_other_size(one):
                out.append(
                    _of_images("square-size", board, f"the robot moves {one.scale:.3g} times as far as its size says")
                )
            elif moved is not None:
                first = pair.names[moved.first]
                fix = f"the {board if moves else camera} that stands moved by about {moved.jump * 1e3:.0f} mm before {first}"
                out.append(
                    _of_images("fixture-moved", first, f"{fix}: fit the rows before and after by themselves (--rows)")
                )
        assert self.kind.pictures is not None
        for k, pictures in enumerate(self.kind.pictures):
            said = None if k == self.poses.camera else focus_drift(pictures)
            if said is not None:
                out.append(_of_images("focus-changed", self.kind.cameras[k], said))
        return out

    @looked_for("images", "mirrored-images", "fixture-moved")
    def tell(self, finding: Finding) -> Finding:
        """A finding of a tracker's campaign in the words of images."""
        if finding.id == "left-handed":
            fix = "the camera, or what saved its images, exchanges left and right: turn that off, and take or mirror them again"
            return replace(finding, id="mirrored-images", subject=(), fix=fix)
        if finding.id in ("points-in-metres", "points-in-other-unit"):
            fix = "the size of the board is in another unit: correct the lengths in its file"
            return replace(finding, id="square-size", subject=(self.board,), fix=fix)
        if finding.id == "points-scaled":
            fix = board_said("the board", float(finding.subject[0]))
            return replace(finding, id="square-size", subject=(self.board,), fix=fix)
        if finding.id == "station-moved":
            row, moved = self.given.ids.index(finding.subject[0]), re.search(r"[\d.]+ mm", finding.fix)
            image, stands = (
                self.kind.labels(self.given.read(0))[row],
                "board" if self.kind.on_wrist[self.poses.camera] else "camera",
            )
            fix = (
                f"the {stands} that stands moved by about {moved[0] if moved else 'some mm'} before {image}: fit the rows before "
                f"and after by themselves (--rows :{row} and --rows {row}:), or take the images again"
            )
            return replace(finding, id="fixture-moved", subject=(image,), fix=fix)
        return replace(
            finding, fix=finding.fix.replace("points", "images").replace("tracker or base", "board or camera")
        )

    def mended(self, case: Case, found: Campaign) -> Campaign:
        """The campaign of a case without the mistakes of the poses alone, each row with the images that belong to it."""
        if np.array_equal(found.points, self.given.points, equal_nan=True):
            return replace(case.campaign, q=found.q, conditions=found.conditions)
        (kind,) = self.given.observations
        image = {point.tobytes(): k for k, point in enumerate(self.given.points[:, 0]) if np.isfinite(point).all()}
        row = np.array([image.get(point.tobytes(), -1) for point in found.points[:, 0]])
        assert kind.of is not None
        of = np.where(row >= 0, kind.of[row], -1)
        return replace(found, observations=(replace(kind, of=of).take(np.arange(len(of))),))


def _of_images(id: str, subject: str, fix: str) -> Finding:
    return Finding(id=id, subject=(subject,), error_before=None, error_after=None, confidence=0.9, fix=fix)
