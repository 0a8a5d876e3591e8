"""Images of a printed board as a camera takes them: the board's plane seen through the lens, with blur, light and noise."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8
from scipy.ndimage import gaussian_filter, map_coordinates

from taskcal.errors import CampaignError
from taskcal.kernels.projection import project
from taskcal.observations.board_drawing import Drawing, draw_board
from taskcal.observations.calibration_board import Board
from taskcal.observations.camera import KILO, LENSES, Lens

SUBPIXELS = 3
"""Rays along either side of a pixel."""

STEP_PX = 4
"""Pixels between those whose place on the board is computed; between them it is interpolated, to 0.005 pixels at 45°."""

TEXELS = 2.0
"""Of the board's picture in a pixel, in the nearest part of the board."""

MAX_TEXELS = 40e6
"""A board of 6000 × 6000 texels is 300 MB."""

STEP_M = 1e-4
"""To either side, by which the slope of a board is found: exact of what is quadratic."""

ROUNDS, SETTLED_PX = 8, 1e-6
"""Of Newton's method for a pixel's place on the board, and how well it is met."""

MARGIN = 0.5
"""Width of the white sheet around the pattern, in squares."""


@dataclass(frozen=True, kw_only=True)
class Exposure:
    """What an image has beside the board's geometry. Grey levels are 0 to 255."""

    black: float = 30.0
    white: float = 210.0
    background: float = 110.0
    gradient: float = 0.15
    """Relative difference of the light from the middle of the image to its left and right edges."""
    blur_px: float = 0.6
    """Standard deviation of the lens's blur."""
    noise: float = 2.0
    """Standard deviation of a pixel's grey level."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Texture:
    """The sheet with the board as a picture."""

    ink: Float[np.ndarray, "h w"]
    """1 where black; a texel of white around the sheet."""
    corner: Float[np.ndarray, " 2"]
    """Of the sheet in the drawing, metres."""
    texel: float
    """Metres."""

    @classmethod
    def of(cls, drawing: Drawing, margin: float, texel: float) -> "_Texture":
        """Draw it, every texel as black as its area is covered."""
        low, high = drawing.outline[:2] - margin, drawing.outline[2:] + margin
        texel = max(texel, float(np.sqrt(np.prod(high - low) / MAX_TEXELS)))
        width, height = np.ceil((high - low) / texel).astype(int)
        ink = np.zeros((height, width), dtype=np.float32)
        for left, top, right, bottom in (drawing.boxes - np.tile(low, 2)) / texel:
            x, y = np.arange(int(left), min(int(right) + 1, width)), np.arange(int(top), min(int(bottom) + 1, height))
            across = np.minimum(x + 1, right) - np.maximum(x, left)
            down = np.minimum(y + 1, bottom) - np.maximum(y, top)
            ink[y[0] : y[-1] + 1, x[0] : x[-1] + 1] += np.outer(down, across).astype(np.float32)
        for cx, cy, r in (drawing.discs - [*low, 0.0]) / texel:
            x, y = np.arange(int(cx - r), int(cx + r) + 2), np.arange(int(cy - r), int(cy + r) + 2)
            away = np.hypot(x + 0.5 - cx, y[:, None] + 0.5 - cy)
            ink[y[0] : y[-1] + 1, x[0] : x[-1] + 1] += np.clip(r - away + 0.5, 0.0, 1.0).astype(np.float32)
        return cls(ink=np.minimum(ink, 1.0), corner=low, texel=texel)

    def look(self, place: Float[np.ndarray, "... 2"]) -> Float[np.ndarray, "... 2"]:
        """How black places of the drawing are, and how much of them is sheet."""
        at = np.nan_to_num((place - self.corner) / self.texel, nan=-9.0)
        sheet = ((at > 0.0) & (at < self.ink.shape[::-1])).all(axis=-1)
        ink = map_coordinates(self.ink, np.moveaxis(at - 0.5, -1, 0)[::-1], order=1, mode="grid-constant")
        return np.stack([ink, sheet], axis=-1)


def render_boards(
    boards: Sequence[Board],
    lens: Lens,
    camera: Float[np.ndarray, " k"],
    T_camera_board: Float[np.ndarray, "boards 4 4"],
    *,
    rng: np.random.Generator,
    exposure: Exposure | None = None,
) -> UInt8[np.ndarray, "h w"]:
    """The image of boards that do not cover each other.

    Args:
        boards: in the sizes that were measured.
        lens: of the camera.
        camera: its numbers, as `Lens.unknowns`.
        T_camera_board: pose of each board in the camera's frame, z forward, metres.
        rng: source of the noise.
        exposure: blur, light and noise.

    Raises:
        CampaignError: a part of a board is behind the camera.
        TaskcalError: a board has markers, and OpenCV is not installed.
    """
    look, image = exposure or Exposure(), np.zeros((lens.height, lens.width))
    image += look.background
    for board, T in zip(boards, T_camera_board, strict=True):
        _lay(image, board, lens, camera, T, look)
    image = gaussian_filter(image, look.blur_px) if look.blur_px else image
    image *= 1.0 + look.gradient * np.linspace(-1.0, 1.0, lens.width)
    return np.clip(np.rint(image + look.noise * rng.normal(size=image.shape)), 0, 255).astype(np.uint8)


def _lay(
    image: Float[np.ndarray, "h w"],
    board: Board,
    lens: Lens,
    camera: Float[np.ndarray, " k"],
    T_camera_board: Float[np.ndarray, "4 4"],
    look: Exposure,
) -> None:
    """Lay a board's sheet into an image, without blur and noise."""
    drawing, margin = draw_board(board), MARGIN * board.square_m
    numbers = camera * np.concatenate([np.full(4, KILO), np.ones(len(camera) - 4)])
    plane = _Plane(LENSES[lens.model], numbers, T_camera_board, board)
    low, high = drawing.outline[:2] - margin, drawing.outline[2:] + margin
    edge = np.stack(np.meshgrid(*np.linspace(low, high, 15).T), axis=-1).reshape(-1, 2)
    seen, jacobian = plane.see(edge)
    if not np.isfinite(seen).all():
        raise CampaignError(f"a part of board '{board.name}' is behind the camera; move it away")
    pad = np.ceil(3.0 * look.blur_px) + 1.0
    first = np.clip(np.floor(seen.min(axis=0) - pad), 0, [lens.width - 1, lens.height - 1]).astype(int)
    last = np.clip(np.ceil(seen.max(axis=0) + pad), 0, [lens.width - 1, lens.height - 1]).astype(int)
    x, y = (np.arange(a, b + 2 * STEP_PX, STEP_PX, dtype=float) - 1.0 for a, b in zip(first, last, strict=True))
    nodes = np.stack(np.meshgrid(x, y), axis=-1)
    place = plane.find(nodes.reshape(-1, 2), edge, seen).reshape(nodes.shape)
    nearest = float(np.linalg.norm(jacobian, axis=1).max())  # pixels per metre
    texture = _Texture.of(drawing, margin, 1.0 / (TEXELS * nearest))
    shown = np.zeros((last[1] - first[1] + 1, last[0] - first[0] + 1, 2))
    for k in range(SUBPIXELS**2):
        off = (np.array(divmod(k, SUBPIXELS)) + 0.5) / SUBPIXELS - 0.5
        down, across = (_between(length, offset) for length, offset in zip(shown.shape, off, strict=False))
        there = np.stack([_mixed(down, _mixed(across, place[..., i].T).T) for i in (0, 1)], axis=-1)
        shown += texture.look(there) / SUBPIXELS**2
    ink, sheet = shown[..., 0], shown[..., 1]
    part = image[first[1] : last[1] + 1, first[0] : last[0] + 1]
    part[:] = sheet * look.white - ink * (look.white - look.black) + (1.0 - sheet) * part


def _between(count: int, offset: float) -> tuple[np.ndarray, np.ndarray]:
    """Of rays in a row of pixels, the node before each, and how far it is towards the next; the first node is a pixel before."""
    at = (np.arange(count) + 1.0 + offset) / STEP_PX
    before = at.astype(int)
    return before, (at - before)[:, None]


def _mixed(between: tuple[np.ndarray, np.ndarray], nodes: Float[np.ndarray, "n m"]) -> Float[np.ndarray, "k m"]:
    before, share = between
    return (1.0 - share) * nodes[before] + share * nodes[before + 1]


@dataclass(frozen=True, eq=False)
class _Plane:
    """A board's plane, or what it bends to, before a camera."""

    lens: int
    camera: Float[np.ndarray, " k"]
    """Pixels."""
    T: Float[np.ndarray, "4 4"]
    board: Board

    def see(self, place: Float[np.ndarray, "n 2"]) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2 2"]]:
        """Pixels of places in the drawing, and their derivatives; NaN behind the camera."""
        n, corners, step = len(place), self.board.raised(place), STEP_M * np.eye(2)
        by_place = np.stack([self.board.raised(place + h) - self.board.raised(place - h) for h in step], axis=2) / (
            2 * STEP_M
        )
        R, t = np.broadcast_to(self.T[:3, :3], (n, 3, 3)), np.broadcast_to(self.T[:3, 3], (n, 3))
        pixel, jacobian = project(self.lens, self.camera, R, t, corners)
        return pixel, jacobian[:, :, :3] @ self.T[:3, :3] @ by_place

    def find(
        self, pixel: Float[np.ndarray, "n 2"], known: Float[np.ndarray, "m 2"], seen: Float[np.ndarray, "m 2"]
    ) -> Float[np.ndarray, "n 2"]:
        """Places in the drawing that are seen in pixels, by Newton's method from those that are known; NaN for none."""
        place = np.full(pixel.shape, np.nan)
        for chunk in np.array_split(np.arange(len(pixel)), len(pixel) // 2000 + 1):
            near = np.argmin(((pixel[chunk, None] - seen) ** 2).sum(axis=2), axis=1)
            at, off = known[near], np.full((len(chunk), 2), np.inf)
            for _ in range(ROUNDS):
                there, jacobian = self.see(at)
                off = pixel[chunk] - there
                good = np.isfinite(off).all(axis=1) & (np.abs(np.linalg.det(jacobian)) > 0.0)
                if np.abs(off[good]).max(initial=0.0) < SETTLED_PX:
                    break
                at = at.copy()
                at[good] += np.linalg.solve(jacobian[good], off[good, :, None])[..., 0]
            place[chunk] = np.where((np.abs(off) < 1e-3).all(axis=1, keepdims=True), at, np.nan)
        return place
