"""A datum cube that stands: the tip of the tool touches faces of known distance and squareness."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.observations.base import (
    Compared,
    Differential,
    Measured,
    Observation,
    ObservedColumns,
    Placed,
    Read,
    Scene,
    refer,
    spots,
    written,
)
from taskcal.observations.plane import FittedPlanes, Planes, Touching, fit_planes
from taskcal.observations.standalone import Found, Search
from taskcal.robot.parameter import ShownUnit

# How a cube stands, by the planes of its faces.

LARGEST_TURN = 0.7
"""Radians by which a touched plane may be turned against the face that it is called: where two names are exchanged, the nearest
cube has a face that is turned by 1.2 at least …"""

LARGEST_LIFT = 5.0
"""… unless that moves its touches by less than so many times what all are off their own planes, root mean square …"""

SMALLEST_LIFT = 1e-3
"""… or by less than this, metres: what is touched at one spot alone has any plane."""


def pose_of_faces(
    fitted: FittedPlanes,
    faces: Int[np.ndarray, " f"],
    normals: Float[np.ndarray, "f 3"],
    stand_off: float,
    names: tuple[str, ...],
) -> Float[np.ndarray, " 6"]:
    """Middle and rotation vector of a cube; a normal is outward if the touches of the other faces are behind.

    A face says the more of how the cube is turned, the wider it was touched.

    Args:
        fitted: planes of all faces.
        faces: numbers of those of this cube.
        normals: theirs, outward, in the cube's axes.
        stand_off: of the tip's centre from the middle, where it touches a face, metres.
        names: of all faces.

    Raises:
        CampaignError: the planes are not the faces that they are called.
    """
    planes, at, (rough, width) = fitted.planes[faces], fitted.middle[faces], fitted.spread[faces, :2].T
    behind = (at.sum(axis=0) - at) / (len(faces) - 1)
    outward = planes[:, :3] * np.sign((planes[:, :3] * (at - behind)).sum(axis=1))[:, None]
    R = se3.nearest_rotation(np.einsum("f,fi,fj->ij", width**2, outward, normals))
    of_faces = normals @ R.T
    lean = np.arccos(np.clip((of_faces * outward).sum(axis=1), -1.0, 1.0))
    lift = np.sin(np.minimum(lean, 0.5 * np.pi)) * width
    lean = np.where(lift > max(LARGEST_LIFT * float(np.sqrt(np.mean(rough**2))), SMALLEST_LIFT), lean, 0.0)
    if lean.max() > LARGEST_TURN:
        raise CampaignError(
            f"the touches of face {names[faces[int(lean.argmax())]]} are turned by {np.degrees(lean.max()):.0f}° from where the "
            "other faces of the cube have it: look at the names of the faces; +x, +y and +z are a right-handed frame, seen from "
            "outside"
        )
    middle = np.linalg.lstsq(of_faces, (of_faces * at).sum(axis=1) - stand_off, rcond=1e-6)[0]
    return np.concatenate([middle, se3.log(R)])


# What is known of a datum cube.


@dataclass(frozen=True, kw_only=True)
class CubeSize:
    """Stated size of a cube."""

    name: str
    edge: float
    """Distance of opposite faces, metres."""
    tip: float
    """Radius of the ball that touches it, metres; zero for a point."""


def sizes_of(columns: ObservedColumns, cubes: Sequence[str]) -> tuple[CubeSize, ...]:
    """Estimate the size of every cube from the rows.

    Raises:
        FileError: they do not say the same, or no length.
    """
    edge = columns.lengths("edge")
    tip = columns.lengths("tip") if "tip" in columns else np.zeros(len(edge))
    out: dict[str, CubeSize] = {}
    for row, name in enumerate(cubes):
        if not name:
            continue
        if not edge[row] > 0.0:
            raise columns.error("give the distance of opposite faces, such as 100", row, "edge")
        size = CubeSize(name=name, edge=float(edge[row]), tip=float(np.nan_to_num(tip[row])))
        if size.tip < 0.0:
            raise columns.error("give the radius of the ball that touches, zero for a point", row, "tip")
        if out.setdefault(name, size) != size:
            raise columns.error(f"cube '{name}' has another edge or tip in a row above; give one of them", row, "edge")
    return tuple(out.values())


# Cubes of a virtual cell, and where a probe touches them.

EDGE, TIP = 0.1, 2e-3
"""Edge of a cube, and radius of the ball that touches it, metres."""

STANDING = ("+x", "-x", "+y", "-y", "+z")
"""Faces that can be touched of a cube that stands."""

UNLEVEL = 0.1
"""Radians by which a cube stands askew at most."""

TOUCHED_SHARE = 0.9
"""Of the width of a face, that is touched."""


class StagedCubes(NamedTuple):
    """Cubes and touches."""

    sizes: tuple[CubeSize, ...]
    faces: tuple[str, ...]
    of: Int[np.ndarray, " n"]
    """Face of each row."""
    pose: Float[np.ndarray, "cubes 6"]
    """Middle and rotation vector of every cube."""
    goals: Float[np.ndarray, "n 3"]
    """Of the ball's centre, were the cubes made as they are stated."""


def stage_cubes(tool: Float[np.ndarray, "n 4 4"], places: int, rng: np.random.Generator) -> StagedCubes:
    """A nearly level cube at each of some places, touched on five faces one after another."""
    middle, rows = tool[spots(tool[:, :3, 3], places), :3, 3], np.arange(len(tool))
    count = len(middle)
    faces = tuple(f"{cube}/{face}" for cube in range(1, count + 1) for face in STANDING)
    sizes = tuple(CubeSize(name=str(cube), edge=EDGE, tip=TIP) for cube in range(1, count + 1))
    limit = np.array([UNLEVEL, UNLEVEL, np.pi])
    turned = rng.uniform(-limit, limit, (count, 3))
    of = rows % len(faces)
    sign, axis = np.array([1, -1, 1, -1, 1])[of % 5], np.array([0, 0, 1, 1, 2])[of % 5]
    inside = 0.5 * TOUCHED_SHARE * EDGE * rng.uniform(-1.0, 1.0, (len(tool), 3))
    inside[rows, axis] = sign * (0.5 * EDGE + TIP)
    goals = se3.apply(se3.pose(se3.exp(turned), middle)[of // 5], inside)
    return StagedCubes(sizes, faces, of, np.concatenate([middle, turned], axis=1), goals)


EDGE_ERROR = 5e-6
"""By how much the distance of opposite faces differs from what is stated, metres (1σ): a ground and measured cube."""

SQUARENESS = 5e-5
"""By how much two faces differ from a right angle, radians (1σ): 5 µm over 100 mm."""

OWN = ("tx", "ty", "tz", "rx", "ry", "rz", "edge", "xy", "xz", "yz")
"""Unknowns of a cube: its middle, its rotation vector, the distance of opposite faces less what is stated, and how far its y
leans to x, its z to x and its z to y."""

TOLD_WITHIN = 0.2
"""Radians within which the touches must tell how a cube is turned, one standard deviation."""

LARGEST_EDGE_ERROR = 1e-2
"""Of an edge that the touches themselves tell, metres: as good as unknown."""

NOTHING = 1e-12
"""Of the information of touches, m² or none, against which what they do not tell at all counts."""

_FACE = re.compile(r"([+-])([xyz])")


@dataclass(frozen=True, eq=False, kw_only=True)
class Cubes(Touching):
    """0 = n·(p − c) − (e/2 + r): the tip p, a ball of radius r, touches the face of normal n of a cube of middle c and edge e.

    Opposite faces tell how large the robot is; faces on one side of the cube alone do not.
    """

    key: ClassVar[str] = "cube"
    needed: ClassVar[tuple[str, ...]] = ("face", "edge")
    label: ClassVar[str] = "face"
    instrument: ClassVar[str] = "cube"
    columns: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {
            "face": ("face", "cube face", "side", "seite"),
            "edge": ("edge", "cube edge", "edge length", "kante", "kantenlänge"),
            "cube": ("cube", "datum cube", "würfel"),
            "tip": ("tip radius", "probe radius"),
        }
    )
    units: ClassVar[Mapping[str, ShownUnit]] = MappingProxyType(
        dict.fromkeys(("rx", "ry", "rz", "xy", "xz", "yz"), ShownUnit.of("rad"))
    )
    things: ClassVar[str] = "faces"
    faces: tuple[str, ...]
    """Names: that of the cube, a stroke, and the face, such as ``a/+x``."""
    sizes: tuple[CubeSize, ...]
    """Of every cube that a face names."""

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Return the unknowns of every cube."""
        return tuple(f"cube {size.name}.{c}" for size in self.sizes for c in OWN)

    @property
    def deviations(self) -> Float[np.ndarray, " u"]:
        """Standard deviations: a cube's pose is as good as unknown, its size known as well as it is made."""
        return np.tile([*(6 * [1.0]), EDGE_ERROR, *(3 * [SQUARENESS])], len(self.sizes))

    @property
    def tells_scale(self) -> bool:
        """Whether opposite faces of a cube are touched."""
        return any(self._opposite(size.name) for size in self.sizes)

    @property
    def shrinks(self) -> bool:
        """Unless opposite faces are touched."""
        return not self.tells_scale

    def _opposite(self, name: str) -> bool:
        return any(f"{name}/+{axis}" in self.faces and f"{name}/-{axis}" in self.faces for axis in "xyz")

    def _normals(self, cube: Int[np.ndarray, " n"], own: Float[np.ndarray, "cubes 10"]) -> Float[np.ndarray, "n 3"]:
        """Outward normal of the face of each row, in the axes of its cube."""
        sign, axis = self._signed(self.numbers)
        normal = np.eye(3)[axis]
        leaning = own[cube, 7:]
        normal[:, 0] += leaning[:, 0] * (axis == 1) + leaning[:, 1] * (axis == 2)
        normal[:, 1] += leaning[:, 2] * (axis == 2)
        return sign[:, None] * normal

    def _signed(self, of: Int[np.ndarray, " n"]) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"]]:
        """Sign and axis of faces by their numbers."""
        signs = np.array([1 if name[-2] == "+" else -1 for name in self.faces])
        axes = np.array(["xyz".index(name[-1]) for name in self.faces])
        return signs[of], axes[of]

    @property
    def _cube(self) -> Int[np.ndarray, " faces"]:
        """Number of the cube of every face."""
        names = [size.name for size in self.sizes]
        return np.array([names.index(face.rpartition("/")[0]) for face in self.faces], dtype=int)

    def differentiate(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"], measured: Measured
    ) -> Differential:
        """Residual and derivatives."""
        n, own = len(target), unknown.reshape(-1, 10)
        cube = self._cube[self.numbers]
        R, apart = se3.exp(own[:, 3:6])[cube], target[:, :3, 3] - own[cube, :3]
        inside = np.einsum("nji,nj->ni", R, apart)
        normal = self._normals(cube, own)
        outward = np.einsum("nij,nj->ni", R, normal)
        stated = np.array([0.5 * size.edge + size.tip for size in self.sizes])
        off = (normal * inside).sum(axis=1) - stated[cube] - 0.5 * own[cube, 6]
        sign, axis = self._signed(self.numbers)
        by_target, by_own = np.zeros((n, 1, 6)), np.zeros((n, len(own), 10))
        by_target[:, 0, :3] = outward
        rows = np.arange(n)
        turning = np.stack([se3.left_jacobian(r) for r in own[:, 3:6]])[cube]
        by_own[rows, cube, :3] = -outward
        by_own[rows, cube, 3:6] = -np.einsum("ni,nij->nj", np.cross(apart, outward), turning)
        by_own[rows, cube, 6] = -0.5
        by_own[rows, cube, 7] = sign * inside[:, 0] * (axis == 1)
        by_own[rows, cube, 8] = sign * inside[:, 0] * (axis == 2)
        by_own[rows, cube, 9] = sign * inside[:, 1] * (axis == 2)
        return Differential(-off[:, None], by_target, by_own.reshape(n, 1, -1))

    def starts(self, rows: Search) -> Iterable[Float[np.ndarray, " x"]]:
        """The tip that leaves all touches nearest to planes, and the cubes whose faces these are.

        Raises:
            CampaignError: planes that are not the faces that they are called, or too few faces.
        """
        planes = Search.of(Planes(planes=self.faces, of=rows.numbers), rows.tool, rows.measured)
        found = planes.find(planes.kind.starts(planes))
        T = se3.translation(*found.x[:3])
        x = (rows.tool @ T)[:, :3, 3]
        yield rows.about(T, self._start(fit_planes(x, rows.numbers, len(self.faces), found.weight), None))

    def place(self, tool: Float[np.ndarray, "n 4 4"], measured: Measured) -> Placed:
        """Place tip and cubes, these as large and square as they are stated: the fit says how far off that is.

        Raises:
            CampaignError: planes that are not the faces that they are called, too few faces, or touches that do not tell how a cube
                is turned.
        """
        found = self.find(tool, measured)
        self._refuse_narrow(found)
        placed = found.placed
        return placed._replace(unknown=(placed.unknown.reshape(-1, 10) * [*(6 * [1.0]), *(4 * [0.0])]).reshape(-1))

    def _refuse_narrow(self, found: Found) -> None:
        """See that the touches tell how every cube is turned, wherever the tip is."""
        residual, by_x = found.rows.linearise(found.x)
        rms = float(np.sqrt(found.weight @ residual[:, 0] ** 2 / found.weight.sum()))
        by_pose = by_x[:, 0, 3:].reshape(len(by_x), -1, 10)[:, :, :6].reshape(len(by_x), -1)
        information = (by_pose.T * found.weight) @ by_pose + NOTHING * np.eye(by_pose.shape[1])
        variance = np.linalg.inv(information).diagonal().reshape(-1, 6)[:, 3:].max(axis=1)
        turned = max(rms, self.resolution) * np.sqrt(variance)
        if turned.max() > TOLD_WITHIN:
            raise CampaignError(
                f"the touches of cube '{self.sizes[int(turned.argmax())].name}' do not tell how it is turned; spread them over its "
                "faces"
            )

    def settle(
        self, target: Float[np.ndarray, "n 4 4"], measured: Measured, known: Float[np.ndarray, " u"]
    ) -> Float[np.ndarray, " u"]:
        """Each cube as its own rows say, as far as they do; edges where opposite faces were touched.

        Raises:
            CampaignError: they do not, and the cube is not known; or the touches are not of the faces that they are called.
        """
        rows = Search.of(self, target, measured)
        free = rows.deviations.reshape(-1, 10).copy()
        free[[self._opposite(size.name) for size in self.sizes], 6] = LARGEST_EDGE_ERROR
        planes = fit_planes(target[rows.seen, :3, 3], rows.numbers, len(self.faces), np.ones(len(rows.tool)))
        start = rows.about(np.eye(4), self._start(planes, known))
        return replace(rows, deviations=free.reshape(-1)).improve(start, scale=None, held=np.eye(3))[0][3:]

    def _start(self, fitted: FittedPlanes, known: Float[np.ndarray, " u"] | None) -> Float[np.ndarray, " u"]:
        """Start of each cube, from planes on three axes at least; else where it is known to be."""
        out = np.zeros((len(self.sizes), 10))
        for number, size in enumerate(self.sizes):
            there = (self._cube == number) & np.isfinite(fitted.planes).all(axis=1)
            faces = np.flatnonzero(there)
            sign, axis = self._signed(faces)
            if len(set(axis.tolist())) == 3:
                normals = sign[:, None] * np.eye(3)[axis]
                stand_off = 0.5 * size.edge + size.tip
                out[number, :6] = pose_of_faces(fitted, faces, normals, stand_off, self.faces)
            elif known is not None and np.isfinite(known.reshape(-1, 10)[number]).all():
                out[number, :6] = known.reshape(-1, 10)[number, :6]
            else:
                raise CampaignError(
                    f"cube '{size.name}' was not touched on three faces that meet, which does not tell how it stands; touch each "
                    "of them four times or more, and one that is opposite to one of them"
                )
        return out.reshape(-1)

    def compare(self, unknown: Float[np.ndarray, " u"]) -> tuple[Compared, ...]:
        """The edge of every cube of which opposite faces were touched."""
        own = unknown.reshape(-1, 10)
        return tuple(
            Compared(name=f"edge of cube {size.name}", stated=size.edge, found=size.edge + float(own[number, 6]))
            for number, size in enumerate(self.sizes)
            if self._opposite(size.name)
        )

    def take(self, rows: Int[np.ndarray, " k"]) -> Observation:
        """The observation of some rows, with the faces and cubes that these name."""
        some = super().take(rows)
        named = {face.rpartition("/")[0] for face in some.named}
        return replace(some, sizes=tuple(size for size in self.sizes if size.name in named))

    @classmethod
    def stage(cls, tool: Float[np.ndarray, "n 4 4"], places: int | None, rng: np.random.Generator) -> Scene:
        """A cube that stands nearly level and is made as well as is said, touched on five faces; the probe is at the TCP."""
        staged = stage_cubes(tool, places or 1, rng)
        kind = cls(faces=staged.faces, of=staged.of, sizes=staged.sizes)
        made = kind.deviations.reshape(-1, 10)[:, 6:]
        unknown = np.concatenate([staged.pose, made * rng.normal(size=made.shape)], axis=1).reshape(-1)

        def approach(target: np.ndarray, rows: np.ndarray) -> np.ndarray:
            T = se3.pose(target[:, :3, :3], staged.goals[rows])
            at = replace(kind, of=staged.of[rows]).differentiate(T, unknown, Measured(np.zeros((len(rows), 3))))
            outward = at.by_target[:, 0, :3]
            T[:, :3, 3] += at.residual * outward / (outward**2).sum(axis=1, keepdims=True)
            return T

        return Scene(kind, "probe", np.eye(4), unknown, approach)

    @classmethod
    def read(cls, columns: ObservedColumns) -> Read | None:
        """A face in every row where the tip touched one, of the cube that is named, or of the only one.

        Raises:
            FileError: a face is not one, a cube is not named, has no edge, or has two.
        """
        if "face" not in columns or "edge" not in columns:
            return None
        texts = columns.texts("face")
        there = np.array([bool(text) for text in texts])
        for row in np.flatnonzero(there):
            if not _FACE.fullmatch(texts[row].strip().lower()):
                raise columns.error(
                    f"'{columns.shown('face', int(row))}' is not a face; write +x, -x, +y, -y, +z or -z",
                    int(row),
                    "face",
                )
        if "cube" in columns:
            columns.refuse_without("cube", there, "name the cube that was touched")
        cubes = columns.texts("cube") if "cube" in columns else ("1",) * len(texts)
        labels = [f"{c}/{f.strip().lower()}" if f else "" for c, f in zip(cubes, texts, strict=True)]
        names, of = refer(tuple(labels))
        if not names:
            return None
        sizes = sizes_of(columns, [cube if seen else "" for cube, seen in zip(cubes, there, strict=True)])
        return Read("probe", cls(faces=names, of=of, sizes=sizes), np.where(there[:, None], np.zeros(3), np.nan))

    def cells(self, measured: Measured) -> dict[str, list[str]] | None:
        """Cube, face, edge and the tip's radius of every row."""
        labels = self.labels(measured)
        size = {one.name: one for one in self.sizes}
        named = [label.rpartition("/")[0] for label in labels]
        return {
            "cube": named,
            "face": [label.rpartition("/")[2] for label in labels],
            "edge_mm": written(np.array([size[name].edge * 1e3 if name else np.nan for name in named])),
            "tip_radius_mm": written(np.array([size[name].tip * 1e3 if name else np.nan for name in named])),
        }
