"""Files of cameras: what is known of one beforehand."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field, model_validator

from taskcal.io.toml_file import Finite, NotNegative, Positive, Section, read_toml
from taskcal.observations.camera import DISTORTION, KILO, Lens
from taskcal.short_repr import short_repr

MAX_PIXELS = 100_000
"""Along a side of an image."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class StatedCamera:
    """A camera as it is stated, and how sure that is."""

    lens: Lens
    numbers: Float[np.ndarray, " k"]
    """As `Lens.unknowns`."""
    uncertainty: Float[np.ndarray, " k"] | None = None
    """Standard uncertainty of each; None where none is stated."""
    focus: tuple[float, float] | None = None
    """Nearest and farthest of what is sharp, metres along the line of sight; None where that is not stated."""
    source: str = ""
    """Its file."""


# Our own form.

Side = Annotated[int, Field(strict=True, ge=1, le=MAX_PIXELS)]


class FocusSection(Section):
    """Distances at which the camera sees sharply."""

    nearest_mm: Positive
    farthest_mm: Positive

    @model_validator(mode="after")
    def _ordered(self) -> "FocusSection":
        if self.nearest_mm >= self.farthest_mm:
            raise ValueError(
                f"nearest_mm = {self.nearest_mm:g} is not below farthest_mm = {self.farthest_mm:g}; swap them"
            )
        return self


class CameraSection(Section):
    """A camera of a file."""

    lens: Literal["pinhole", "fisheye"] = "pinhole"
    width: Side
    height: Side
    fx: Positive
    fy: Positive | None = None
    cx: Finite | None = None
    cy: Finite | None = None
    distortion: dict[str, Finite] = Field(default_factory=dict)
    u: dict[str, NotNegative] | None = None
    focus: FocusSection | None = None

    @model_validator(mode="after")
    def _known(self) -> "CameraSection":
        own = DISTORTION[self.lens]
        for field, keys, known in (
            ("distortion", self.distortion, own),
            ("u", self.u or {}, ("fx", "fy", "cx", "cy", *own)),
        ):
            for key in keys:
                if key not in known:
                    raise ValueError(f"{field} has '{key}', and a {self.lens} lens {', '.join(known)}")
        return self

    def camera(self, source: str) -> StatedCamera:
        """The camera it describes."""
        lens = Lens(model=self.lens, width=self.width, height=self.height)
        centre = 0.5 * (self.width - 1), 0.5 * (self.height - 1)
        given = [self.fx, self.fy, self.cx, self.cy]
        start = [
            float(value if stated is None else stated)
            for stated, value in zip(given, (0.0, self.fx, *centre), strict=True)
        ]
        numbers = np.array([*start, *(self.distortion.get(name, 0.0) for name in DISTORTION[self.lens])])
        size = np.repeat([KILO, 1.0], [4, len(numbers) - 4])
        u = None if self.u is None else np.array([self.u.get(name, 0.0) for name in lens.unknowns]) / size
        focus = None if self.focus is None else (self.focus.nearest_mm * 1e-3, self.focus.farthest_mm * 1e-3)
        return StatedCamera(lens=lens, numbers=numbers / size, uncertainty=u, focus=focus, source=source)


class CameraFile(Section):
    """A file of a camera."""

    camera: CameraSection


def read_camera(path: str | Path) -> StatedCamera:
    """Read the camera of a file.

    Raises:
        FileError: it is missing, no TOML, or does not describe a camera.
    """
    path = Path(path)
    return read_toml(path, CameraFile).camera.camera(path.name)
