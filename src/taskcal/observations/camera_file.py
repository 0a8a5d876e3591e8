"""Files of cameras: what is known of one beforehand."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, cast

import numpy as np
from jaxtyping import Float
from pydantic import Field, model_validator

from taskcal.errors import FileError, TaskcalError, shown
from taskcal.io.text_file import read_text
from taskcal.io.toml_file import FileSection, Finite, NotNegative, Positive, read_toml
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


class FocusSection(FileSection):
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


class CameraSection(FileSection):
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


class CameraFile(FileSection):
    """A file of a camera."""

    camera: CameraSection


def read_camera(path: str | Path) -> StatedCamera:
    """Read the camera of a file: our own TOML, ROS's ``camera_info`` YAML, or YAML of OpenCV's FileStorage.

    Raises:
        FileError: it is missing, or does not describe a camera that a fit has.
        TaskcalError: it is YAML, and PyYAML is not installed.
    """
    path = Path(path)
    if path.suffix.lower() in YAML_SUFFIXES:
        return _of_yaml(path)
    return read_toml(path, CameraFile).camera.camera(path.name)


# YAML of ROS and of OpenCV: the same keys, matrices as rows, columns and data.

YAML_SUFFIXES = (".yaml", ".yml")
MAX_FILE_MB = 1.0

MATRIX = "camera_matrix", "cameraMatrix", "K", "k"
DISTORTIONS = "distortion_coefficients", "distCoeffs", "dist_coeffs", "D", "d"
MODELS = {
    "plumb_bob": "pinhole",
    "pinhole": "pinhole",
    "rational_polynomial": "pinhole",
    "equidistant": "fisheye",
    "fisheye": "fisheye",
}
"""Names of lenses and distortion models, as ROS, Kalibr and Taskcal write them."""


def _of_yaml(path: Path) -> StatedCamera:
    content = _load_yaml(path)
    stated = [next((content[k] for k in (f"image_{side}", side) if k in content), None) for side in ("width", "height")]
    size = [value for value in stated if isinstance(value, int) and 0 < value <= MAX_PIXELS]
    if len(size) < 2:
        raise FileError(path, "states no image_width and image_height; add the size of an image, whole pixels")
    named = str(content.get("distortion_model", content.get("lens", "plumb_bob")))
    if named not in MODELS:
        raise FileError(path, f"has the distortion model '{shown(named)}'; a fit has plumb_bob and equidistant")
    K, D = _matrix(path, content, MATRIX), _matrix(path, content, DISTORTIONS)
    if K.size != 9:
        raise FileError(path, f"its camera matrix has {K.size} numbers; it must be 3 × 3")
    K, lens = K.reshape(3, 3), Lens(model=MODELS[named], width=size[0], height=size[1])
    wrong = np.abs(K - np.diag(np.diag(K)))[[0, 1, 2, 2], [1, 0, 0, 1]].max() > 0.0 or K[2, 2] != 1.0
    if wrong or min(K[0, 0], K[1, 1]) <= 0.0:
        raise FileError(path, "its camera matrix is not fx 0 cx, 0 fy cy, 0 0 1 with positive focal lengths")
    count = len(DISTORTION[lens.model])
    if np.abs(D[count:]).max(initial=0.0) > 0.0:
        raise FileError(
            path,
            f"has {len(D)} distortion coefficients, and a fit {count} ({', '.join(DISTORTION[lens.model])}): calibrate without the "
            "rational model, or leave the camera out and let the images tell it",
        )
    D = np.pad(D[:count], (0, max(count - len(D), 0)))
    numbers = np.concatenate([np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2]]) / KILO, D])
    return StatedCamera(lens=lens, numbers=numbers, source=path.name)


def _load_yaml(path: Path) -> dict[str, Any]:
    """Keys and values of a file."""
    try:
        import yaml
    except ImportError as error:
        raise TaskcalError(
            f"{path.name} is YAML, which PyYAML reads, and that is not installed: pip install 'taskcal[images]'"
        ) from error
    text = read_text(path, MAX_FILE_MB, otherwise="is not UTF-8 text; YAML is")
    text = re.sub(r"\A%YAML[^\n]*\n", "", text)  # OpenCV writes %YAML:1.0, which is none

    class Loader(yaml.SafeLoader):
        """With OpenCV's matrices."""

    def matrix(loader: Any, node: Any) -> Any:
        return loader.construct_mapping(node, deep=True)

    Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", matrix)
    documents = list[Any]()
    try:
        loader = Loader(text)
        while loader.check_data():
            documents.append(loader.get_data())
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = None if mark is None else mark.line + 1
        raise FileError(path, f"is not YAML: {getattr(error, 'problem', error)}", line=line) from error
    content, *others = [one for one in documents if one is not None] or [None]  # ROS ends a message with ---
    if others:
        raise FileError(path, f"has {len(others) + 1} documents, which --- divides; leave one camera in it")
    if not isinstance(content, dict):
        raise FileError(path, "is not the YAML of a camera, which has image_width, camera_matrix and others")
    return {str(key): value for key, value in cast("dict[Any, Any]", content).items()}


def _matrix(path: Path, content: dict[str, Any], names: Sequence[str]) -> Float[np.ndarray, " n"]:
    """The numbers of a matrix, by the first of some names."""
    found = next((content[name] for name in names if name in content), None)
    data: Any = cast("dict[str, Any]", found).get("data") if isinstance(found, dict) else found
    try:
        values = np.array(data, dtype=float).reshape(-1)
    except (TypeError, ValueError):
        values = np.array([np.nan])
    if found is None or not np.isfinite(values).all():
        none = "; those of a lens without distortion are zeros" if names is DISTORTIONS else ""
        raise FileError(path, f"has no {names[0]} with numbers, as rows, cols and data{none}")
    return values


# A camera that is used in a fit.

UNSTATED_FOCAL, UNSTATED_CENTRE = 5e-3, 5e-3
"""Standard uncertainties of focal lengths, over these, and of the centre, over the width, of a camera whose file states none:
lenses that are refocused, or warm up, change by some tenths of a per cent."""

UNSTATED_DISTORTION = 0.05
"""Of distortion, times its prior: two calibrations of one lens differ by 0.01 to 0.05 in k1 and k2."""


def as_prior(camera: StatedCamera, *, exact: bool) -> StatedCamera:
    """The camera with an uncertainty: none if it is to be exact, else that which is stated, or a usual one."""
    if exact:
        return replace(camera, uncertainty=np.zeros(len(camera.numbers)))
    if camera.uncertainty is not None:
        return camera
    width = camera.lens.width / KILO
    u = UNSTATED_DISTORTION * camera.lens.deviations
    u[:2], u[2:4] = UNSTATED_FOCAL * camera.numbers[:2], UNSTATED_CENTRE * width
    return replace(camera, uncertainty=u)
