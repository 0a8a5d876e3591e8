"""A calibrated robot as a tree of links and joints: URDF for ROS, MJCF for MuJoCo, SDFormat for Gazebo, USD for Isaac and others.

Every defect is in the places of the joints, which stand at the controller's own values. A joint that the controller couples with
others is a row of joints about one axis, of which those that follow have no motor.
"""

import csv
import io
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal
from xml.sax.saxutils import quoteattr

import numpy as np
from jaxtyping import Float

from taskcal.arguments import checked
from taskcal.errors import FileError, TaskcalError, WrongValue, shown
from taskcal.export.forms import (
    CalibratedChain,
    ChainJoint,
    Export,
    WrittenChain,
    export_as,
    moved,
    poses_or_spread,
    roll_pitch_yaw,
    spread_poses,
)
from taskcal.export.model_comparison import match_joints
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.kernels.chain import JointKind
from taskcal.robot.catalogue import load_robot
from taskcal.robot.importers.urdf import Looks, plain_joint_names, read_looks
from taskcal.robot.mesh_file import MESH_ENDINGS, read_triangles
from taskcal.robot.robot import Robot

Form = Literal["urdf", "mjcf", "sdf", "usd"]

NAMES: dict[Form, str] = {"urdf": "a URDF", "mjcf": "an MJCF", "sdf": "an SDF", "usd": "a USD"}
ENDINGS: dict[Form, str] = {"urdf": ".urdf", "mjcf": ".xml", "sdf": ".sdf", "usd": ".usda"}

ANYWHERE = 1000.0
"""Metres to which a sliding joint without limits may go; URDF wants a limit."""

UNSTATED_SPEED = 1.0
"""Radians or metres per second of a joint whose speed nobody states: URDF wants one, and planners refuse zero. Slow."""

FAR_M = 10.0
"""Distance of a joint's frame from the one before, from which on it is moved along its axis: tables have nearly parallel axes meet
hundreds of metres away, where viewers and solvers lose digits."""

MAX_APART_M = 1e-4
"""Distance, and angle in radians, by which axes of a URDF with meshes may differ from the robot's: four digits of π are less."""

BASE = "base_link"
MASS = "1", "0.01"
"""Kilograms and kg·m² of every link that moves, which no calibration tells: simulators refuse, or make up, what weighs nothing."""


def tip_of(robot: Robot) -> str:
    """Name of the tool's link: ROS calls the flange ``tool0``."""
    return "tool0" if np.allclose(robot.T_flange_tool, np.eye(4), atol=1e-12) else "tool"


def links_of(robot: Robot) -> tuple[str, str]:
    """Names of the links of base and tool in a URDF: those of the one that the robot was imported from, so that the two exchange.

    Where that calls one of them as a joint's link is called here, or names none, they are `BASE` and `tip_of`.
    """
    taken = {f"{name}{ending}" for name in robot.joint_names for ending in ("_link", "_motor")}
    beside = tuple(f"{name}_with_" for name in robot.joint_names)
    own = robot.links
    free = own is not None and own[0] != own[1] and not any(one in taken or one.startswith(beside) for one in own)
    return own if own is not None and free else (BASE, tip_of(robot))


@dataclass(frozen=True, eq=False, kw_only=True)
class Mesh:
    """A mesh on a link."""

    file: Path
    scale: tuple[float, float, float]
    origin: Float[np.ndarray, "4 4"]
    """Pose in the link, metres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TreeJoint:
    """A joint about, or along, its own z axis, and the link that it moves, whose frame is the joint's."""

    name: str
    kind: JointKind
    parent: str
    child: str
    origin: Float[np.ndarray, "4 4"]
    """Pose in the parent where the joint is at zero."""
    sign: float = 1.0
    """−1 where it turns the other way about z."""
    follows: tuple[str, float] | None = None
    """The joint that it follows and how far; None for a joint with a motor."""
    limits: tuple[float, float] | None = None
    """Radians or metres; None where there are none."""
    speed: float = np.inf
    """Radians or metres per second; infinite where nobody states it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Tree:
    """Links and joints, from `BASE`."""

    name: str
    joints: tuple[TreeJoint, ...]
    tip: str
    """The tool's name."""
    tip_on: str
    """The link on which it is."""
    tip_origin: Float[np.ndarray, "4 4"]
    warning: str = ""
    """What the file says above the robot, on one line."""
    shapes: Mapping[str, Sequence[Mesh]] = field(default_factory=dict[str, Sequence[Mesh]])
    """By link."""
    folder: Path = Path()
    """Where the file will be."""
    ends: tuple[str, str] = (BASE, "tool0")
    """Names of the links of base and tool in a URDF."""

    @classmethod
    def of(cls, chain: CalibratedChain) -> "Tree":
        """The tree of a chain."""
        joints, on, pending = list[TreeJoint](), BASE, np.eye(4)
        for joint in chain.joints:
            pending = pending @ joint.before @ moved(joint.kind, chain.offset[[joint.coordinate]])[0]
            far = float(pending[:3, 2] @ pending[:3, 3]) if np.linalg.norm(pending[:3, 3]) > FAR_M else 0.0
            along = se3.translation(0.0, 0.0, far)
            joints += _coupled(chain, joint, on, pending @ se3.inverse(along))
            on, pending = joints[-1].child, along
        return cls(
            name=chain.robot.name,
            joints=tuple(joints),
            tip=tip_of(chain.robot),
            ends=links_of(chain.robot),
            tip_on=on,
            tip_origin=pending @ chain.end,
            warning=shown(chain.warning, 200).replace("--", "- -") if chain.warning else "",
        )

    @property
    def at_zero(self) -> dict[str, Float[np.ndarray, "4 4"]]:
        """Poses of the links in the base where all joints are at zero."""
        poses = {BASE: np.eye(4)}
        for joint in self.joints:
            poses[joint.child] = poses[joint.parent] @ joint.origin
        return poses

    def path_to(self, file: Path) -> str:
        """A file as the written one names it: from its own folder on."""
        return Path(os.path.relpath(file, self.folder)).as_posix()


def _coupled(
    chain: CalibratedChain, joint: ChainJoint, parent: str, origin: Float[np.ndarray, "4 4"]
) -> Iterator[TreeJoint]:
    """A joint of a chain, and those that its coupling takes."""
    row, robot = chain.matrix[joint.coordinate], chain.robot
    own = joint.coordinate if joint.coordinate < len(robot.joints) else -1
    plain = TreeJoint(name=joint.name, kind=joint.kind, parent=parent, child=f"{joint.name}_link", origin=origin)
    if own >= 0:
        limits, speed = robot.joints[own].limits, robot.joints[own].speed
        plain = replace(plain, limits=limits if np.isfinite(limits).all() else None, speed=speed)
    if own >= 0 and abs(row[own]) != 1.0:  # its motor stands beside the chain, which follows it with its ratio
        yield replace(plain, parent=BASE, child=f"{joint.name}_motor", origin=np.eye(4))
        own = -1
    elif own >= 0:
        yield replace(plain, sign=float(row[own]))
        parent, origin = plain.child, np.eye(4)
    for other in np.flatnonzero(row):
        if other == own:
            continue
        name = f"{joint.name}_with_{robot.joint_names[other]}"
        yield TreeJoint(
            name=name,
            kind=joint.kind,
            parent=parent,
            child=f"{name}_link",
            origin=origin,
            follows=(robot.joint_names[other], float(row[other])),
        )
        parent, origin = f"{name}_link", np.eye(4)


@checked
def export_description(
    calibration: Calibration,
    form: Form,
    q: Float[np.ndarray, "n joints"] | None = None,
    *,
    meshes: str | Path | None = None,
    folder: str | Path = ".",
    accept_loss: bool = False,
    accept_uncertain: bool = False,
) -> Export:
    """Export the calibrated robot as links and joints.

    Args:
        calibration: the robot.
        form: ``urdf``, ``mjcf`` (MuJoCo), ``sdf`` (Gazebo) or ``usd``.
        q: joint positions at which a loss is measured; all over the ranges by default.
        meshes: a URDF of the same robot, whose visible meshes the links get; behind a ``#`` its tip.
        folder: where the file will be: meshes are named from there on.
        accept_loss: write it although it loses something.
        accept_uncertain: write it although the calibration knows less there than the robot's tolerances do.

    Raises:
        TaskcalError: the model has parts that no such file holds, such as gear harmonics; the message has the loss. Or the URDF
            with the meshes is another robot's.
        FileError: a mesh is not there.
    """
    shapes = {} if meshes is None else _shapes(calibration, str(meshes))

    def write(chain: CalibratedChain) -> WrittenChain:
        return _written(chain, form, shapes, Path(folder))

    return export_as(NAMES[form], write, calibration, q, accept_loss=accept_loss, accept_uncertain=accept_uncertain)


def _written(chain: CalibratedChain, form: Form, shapes: Mapping[str, Sequence[Mesh]], folder: Path) -> WrittenChain:
    remarks = dict[str, None]()
    unstated = [joint.name for joint in chain.robot.joints if not np.isfinite(joint.speed)]
    if form == "urdf" and unstated:
        said = f"the robot file states no speed of {', '.join(unstated)}: the URDF has {UNSTATED_SPEED:g} rad/s (m/s)"
        remarks[said] = None
    if form != "urdf":
        said = (
            f"every link has a mass of {MASS[0]} kg: a calibration has no masses; set them before you simulate forces"
        )
        remarks[said] = None
    text = _TEXTS[form](replace(Tree.of(chain), shapes=shapes, folder=folder), remarks)
    return WrittenChain(text=text, poses=chain.poses, remarks=tuple(remarks))


@checked
def export_urdf(
    calibration: Calibration,
    q: Float[np.ndarray, "n joints"] | None = None,
    *,
    accept_loss: bool = False,
    accept_uncertain: bool = False,
) -> Export:
    """Export the calibrated robot as URDF, as `export_description` does."""
    return export_description(calibration, "urdf", q, accept_loss=accept_loss, accept_uncertain=accept_uncertain)


# Robots that the calibration cannot tell from this one.


def draw_sample(calibration: Calibration, number: int, seed: int = 0) -> Calibration:
    """A calibration whose estimate is drawn from the posterior: of a robot that the measurements cannot tell from this one.

    Args:
        calibration: the robot.
        number: which of them; the same with the same seed, however many are drawn.
        seed: of the random numbers.
    """
    values, vectors = np.linalg.eigh(calibration.z_covariance)
    normal = np.random.default_rng([seed, number]).normal(size=len(values))
    return replace(calibration, z=calibration.z + vectors @ (np.sqrt(np.maximum(values, 0.0)) * normal))


@checked
def export_samples(
    calibration: Calibration,
    form: Form,
    count: int,
    q: Float[np.ndarray, "n joints"] | None = None,
    *,
    seed: int = 0,
    meshes: str | Path | None = None,
    folder: str | Path = ".",
    accept_loss: bool = False,
    accept_uncertain: bool = False,
) -> Export:
    """Export robots drawn from the posterior, as to train a controller on all that the robot may be.

    Their tool points spread as `Calibration.tool_covariance` has it in the measured range without its ``model_error``: what errs at
    a single pose is no robot's geometry, and not in them.

    Args:
        calibration: the robot.
        form: as of `export_description`, like all that follows.
        count: how many robots.
        q: joint positions at which a loss is measured.
        seed: of the random numbers.
        meshes: a URDF with meshes.
        folder: where the files will be.
        accept_loss: write them although they lose something.
        accept_uncertain: write them although the calibration knows less there than the robot's tolerances do.

    Returns:
        `Export.files`: the robots, and ``parameters.csv`` with number, seed, file and parameters of each.

    Raises:
        WrongValue: no robots are asked for.
        TaskcalError: as of `export_description`.
    """
    if count < 1:
        raise WrongValue(f"count is {count}; draw one robot or more")
    keys: dict[str, Any] = {
        "meshes": meshes,
        "folder": folder,
        "accept_loss": accept_loss,
        "accept_uncertain": accept_uncertain,
    }
    mean = export_description(calibration, form, q, **keys)
    shapes = {} if meshes is None else _shapes(calibration, str(meshes))
    q = poses_or_spread(calibration, q)
    model = calibration.model
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(["sample", "seed", "file", *(f"{p.name} [{p.shown.name}]" for p in model.parameters)])
    files = dict[str, str]()
    for k in range(count):
        sample, file = (
            draw_sample(calibration, k, seed),
            f"{model.robot.name}_{k:0{len(str(count - 1))}d}{ENDINGS[form]}",
        )
        files[file] = _written(CalibratedChain.of(sample, q), form, shapes, Path(folder)).text
        values = zip(sample.estimate, model.parameters, strict=True)
        writer.writerow([k, seed, file, *(repr(float(value) * p.shown.factor) for value, p in values)])
    return replace(mean, text="", files={**files, "parameters.csv": table.getvalue()})


# Meshes of a URDF of the same robot.


def _shapes(calibration: Calibration, source: str) -> dict[str, list[Mesh]]:
    """Meshes by the links of the tree, each where it is on the nominal robot.

    Raises:
        TaskcalError: the URDF is of another robot.
        FileError: a mesh is not there.
    """
    robot, given = calibration.model.robot, load_robot(source)
    path = Path(source if Path(source).is_file() else source.rpartition("#")[0])
    order = match_joints(given, robot)
    q = spread_poses(calibration, 20)
    apart = _apart(robot, given, q, order)
    if apart > MAX_APART_M:
        raise TaskcalError(
            f"{shown(source)} is not the robot that was calibrated, {robot.name}: its axes are up to {apart * 1e3:.2g} mm, or "
            f"mrad, from those; give the URDF from which {robot.name} was imported"
        )
    looks = read_looks(path)
    at_zero = Tree.of(
        CalibratedChain.of_model(calibration.model.nominal, np.zeros(len(calibration.model.nominal)), q)
    ).at_zero
    posed, shapes = looks.link_poses({}), dict[str, list[Mesh]]()
    for visual in looks.visuals:
        link = _moves_with(looks, visual.link, at_zero)
        origin = se3.inverse(at_zero[link]) @ posed[visual.link] @ visual.origin
        shapes.setdefault(link, []).append(Mesh(file=_found(path, visual.file), scale=visual.scale, origin=origin))
    return shapes


def _apart(robot: Robot, other: Robot, q: Float[np.ndarray, "n joints"], order: Sequence[int]) -> float:
    """Largest distance, metres, and angle of the axes of two robots; where on its axis a frame is does not count."""
    own, theirs = robot.joint_frames(q)[:, list(order)], other.joint_frames(q[:, list(order)])
    z, between = own[..., :3, 2], theirs[..., :3, 3] - own[..., :3, 3]
    return float(
        max(np.linalg.norm(np.cross(z, between), axis=-1).max(), np.linalg.norm(theirs[..., :3, 2] - z, axis=-1).max())
    )


def _moves_with(looks: Looks, link: str, known: Mapping[str, object]) -> str:
    """The link of the tree that moves as a link of the URDF does."""
    names = plain_joint_names(looks.tree)
    for joint in reversed(looks.tree.path_to(link)):
        if joint.moves and f"{names[joint.name]}_link" in known:
            return f"{names[joint.name]}_link"
    return BASE


def _found(urdf: Path, file: str) -> Path:
    """The file of a mesh: from the URDF's folder on, or from the package above it that has its name.

    Raises:
        FileError: it is not there.
    """
    scheme, apart, rest = file.partition("://")
    if apart and scheme == "package":
        package, _, rest = rest.partition("/")
        above = urdf.resolve().parents
        places = [
            *(folder / rest for folder in above if folder.name == package),
            *(folder / package / rest for folder in above),
        ]
    else:
        places = [urdf.resolve().parent / (rest if apart else file)]
    for place in places:
        if place.is_file():
            if place.suffix.lower() not in MESH_ENDINGS:
                break
            return place
    endings = ", ".join(MESH_ENDINGS)
    raise FileError(urdf, f"names the mesh '{shown(file, 80)}', which is not there, or not one of {endings}")


# The texts.


def urdf_text(tree: Tree, _: dict[str, None] | None = None) -> str:
    """The URDF of a tree."""
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        *_warned(tree),
        f"<robot name={quoteattr(tree.name)}>",
        *_urdf_link(tree, BASE),
    ]
    base, tip = (quoteattr(name) for name in tree.ends)
    for joint in tree.joints:
        kind = "continuous" if joint.kind == "revolute" and joint.limits is None else joint.kind
        limits = (-ANYWHERE, ANYWHERE) if joint.kind == "prismatic" and joint.limits is None else joint.limits
        bounds = f'lower="{limits[0]!r}" upper="{limits[1]!r}" ' if limits is not None else ""
        speed = joint.speed if np.isfinite(joint.speed) else UNSTATED_SPEED
        lines += [
            *_urdf_link(tree, joint.child),
            f'  <joint name="{joint.name}" type="{kind}">',
            f"    <parent link={base if joint.parent == BASE else quoteattr(joint.parent)}/>",
            f'    <child link="{joint.child}"/>',
            f"    {_origin(joint.origin)}",
            f'    <axis xyz="0 0 {joint.sign:.0f}"/>',
            f'    <limit {bounds}velocity="{float(speed)!r}" effort="0"/>',
            *(
                [f'    <mimic joint="{joint.follows[0]}" multiplier="{joint.follows[1]!r}" offset="0"/>']
                if joint.follows
                else []
            ),
            "  </joint>",
        ]
    lines += [
        f"  <link name={tip}/>",
        f'  <joint name={quoteattr(f"{tree.ends[1]}_fixed")} type="fixed">',
        f"    <parent link={base if tree.tip_on == BASE else quoteattr(tree.tip_on)}/>",
        f"    <child link={tip}/>",
        f"    {_origin(tree.tip_origin)}",
        "  </joint>",
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


def _urdf_link(tree: Tree, link: str) -> list[str]:
    shapes, name = tree.shapes.get(link, ()), quoteattr(tree.ends[0] if link == BASE else link)
    if not shapes:
        return [f"  <link name={name}/>"]
    visuals = [
        f"    <visual>{_origin(shape.origin)}<geometry><mesh filename={quoteattr(tree.path_to(shape.file))} "
        f'scale="{_numbers(shape.scale)}"/></geometry></visual>'
        for shape in shapes
    ]
    return [f"  <link name={name}>", *visuals, "  </link>"]


def _warned(tree: Tree) -> list[str]:
    return [f"<!-- {tree.warning} -->"] if tree.warning else []


def _origin(T: Float[np.ndarray, "4 4"]) -> str:
    return f'<origin xyz="{_numbers(T[:3, 3])}" rpy="{_numbers(roll_pitch_yaw(T[:3, :3]))}"/>'


def _numbers(values: Sequence[float] | Float[np.ndarray, " n"], between: str = " ") -> str:
    return between.join(repr(float(value) + 0.0) for value in values)


def _quaternion(T: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, " 4"]:
    """Scalar first."""
    return np.roll(se3.to_quaternion(T[None, :3, :3])[0], 1)


MUJOCO_MESHES = (".stl", ".obj", ".msh")
"""What MuJoCo reads."""


def mjcf_text(tree: Tree, remarks: dict[str, None]) -> str:
    """The model for MuJoCo of a tree; joints that follow others do by an equality."""
    assets: dict[tuple[Path, tuple[float, float, float]], str] = {}

    def place(T: Float[np.ndarray, "4 4"]) -> str:
        return f'pos="{_numbers(T[:3, 3])}" quat="{_numbers(_quaternion(T))}"'

    def inside(link: str, indent: str) -> Iterator[str]:
        for shape in tree.shapes.get(link, ()):
            if shape.file.suffix.lower() in MUJOCO_MESHES:
                mesh = assets.setdefault((shape.file, shape.scale), f"mesh_{len(assets)}")
                yield f'{indent}<geom type="mesh" mesh="{mesh}" class="visual" {place(shape.origin)}/>'
            else:
                remarks[
                    f"not in the model: {shown(shape.file.name)}, since MuJoCo reads STL and OBJ alone; convert it"
                ] = None
        for joint in (joint for joint in tree.joints if joint.parent == link):
            kind = "slide" if joint.kind == "prismatic" else "hinge"
            limits = f' range="{_numbers(joint.limits)}"' if joint.limits is not None else ""
            yield f'{indent}<body name="{joint.child}" {place(joint.origin)}>'
            yield f'{indent}  <inertial pos="0 0 0" mass="{MASS[0]}" diaginertia="{" ".join([MASS[1]] * 3)}"/>'
            yield f'{indent}  <joint name="{joint.name}" type="{kind}" axis="0 0 {joint.sign:.0f}"{limits}/>'
            yield from inside(joint.child, indent + "  ")
            yield f"{indent}</body>"
        if link == tree.tip_on:
            yield f'{indent}<site name="{tree.tip}" {place(tree.tip_origin)}/>'

    bodies = list(inside(BASE, "      "))
    follow = [
        f'    <joint joint1="{joint.name}" joint2="{joint.follows[0]}" polycoef="0 {joint.follows[1]!r} 0 0 0"/>'
        for joint in tree.joints
        if joint.follows
    ]
    meshes = [
        f'    <mesh name="{name}" file={quoteattr(tree.path_to(file))} scale="{_numbers(scale)}"/>'
        for (file, scale), name in assets.items()
    ]
    lines = [
        *_warned(tree),
        f"<mujoco model={quoteattr(tree.name)}>",
        '  <compiler angle="radian" autolimits="true"/>',
        '  <default><default class="visual"><geom group="2" contype="0" conaffinity="0" mass="0"/></default></default>',
        *(["  <asset>", *meshes, "  </asset>"] if meshes else []),
        "  <worldbody>",
        f'    <body name="{BASE}">',
        *bodies,
        "    </body>",
        "  </worldbody>",
        *(["  <equality>", *follow, "  </equality>"] if follow else []),
        "</mujoco>",
    ]
    return "\n".join(lines) + "\n"


def sdf_text(tree: Tree, _: dict[str, None] | None = None) -> str:
    """The SDFormat model of a tree, fixed to the world."""

    def pose(T: Float[np.ndarray, "4 4"], on: str = "") -> str:
        relative = f' relative_to="{on}"' if on else ""
        return f"<pose{relative}>{_numbers([*T[:3, 3], *roll_pitch_yaw(T[:3, :3])])}</pose>"

    def link(name: str, on: str) -> Iterator[str]:
        yield f'    <link name="{name}">'
        yield f"      {pose(np.eye(4), on)}"
        moments = "".join(f"<{k}>{MASS[1] if k in ('ixx', 'iyy', 'izz') else 0}</{k}>" for k in _MOMENTS)
        yield f"      <inertial><mass>{MASS[0]}</mass><inertia>{moments}</inertia></inertial>"
        for k, shape in enumerate(tree.shapes.get(name, ())):
            mesh = f"<uri>{_escaped(tree.path_to(shape.file))}</uri><scale>{_numbers(shape.scale)}</scale>"
            yield f'      <visual name="visual_{k}">{pose(shape.origin)}<geometry><mesh>{mesh}</mesh></geometry></visual>'
        yield "    </link>"

    lines = [
        '<?xml version="1.0"?>',
        *_warned(tree),
        '<sdf version="1.11">',
        f"  <model name={quoteattr(tree.name)}>",
        f'    <joint name="world_fixed" type="fixed"><parent>world</parent><child>{BASE}</child></joint>',
        *link(BASE, ""),
    ]
    for joint in tree.joints:
        follows = ""
        if joint.follows:
            ratio = f"<multiplier>{joint.follows[1]!r}</multiplier><offset>0</offset><reference>0</reference>"
            follows = f'<mimic joint="{joint.follows[0]}">{ratio}</mimic>'
        limits = "" if joint.limits is None else "<lower>{!r}</lower><upper>{!r}</upper>".format(*joint.limits)
        if np.isfinite(joint.speed):
            limits += f"<velocity>{joint.speed!r}</velocity>"
        lines += [
            f'    <joint name="{joint.name}" type="{joint.kind}">',
            f"      {pose(joint.origin, joint.parent)}",
            f"      <parent>{joint.parent}</parent><child>{joint.child}</child>",
            f"      <axis><xyz>0 0 {joint.sign:.0f}</xyz>{follows}<limit>{limits}</limit></axis>",
            "    </joint>",
            *link(joint.child, joint.name),
        ]
    lines += [
        f'    <frame name="{tree.tip}" attached_to="{tree.tip_on}">{pose(tree.tip_origin)}</frame>',
        "  </model>",
        "</sdf>",
    ]
    return "\n".join(lines) + "\n"


_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def _escaped(text: str) -> str:
    return quoteattr(text)[1:-1]


def usd_text(tree: Tree, _: dict[str, None] | None = None) -> str:
    """The USD stage of a tree: rigid bodies where all joints are at zero, and joints of the physics schema.

    Bodies stand in double precision; the schema has the joints' own frames in single, a hundredth of a micrometre.

    Raises:
        TaskcalError: joints follow others.
    """
    follower = next((joint for joint in tree.joints if joint.follows), None)
    if follower is not None:
        raise TaskcalError(
            f"{tree.name} has {follower.name}, which no joint of USD's physics can do: follow another; write an MJCF or SDF "
            "(--form mjcf, --form sdf)"
        )
    name = re.sub(r"\W", "_", f"_{tree.name}" if tree.name[:1].isdigit() else tree.name, flags=re.ASCII)
    lines = [
        "#usda 1.0",
        f'(\n    defaultPrim = "{name}"\n    metersPerUnit = 1\n    kilogramsPerUnit = 1\n    upAxis = "Z"\n)',
        *([f"# {tree.warning}"] if tree.warning else []),
        f'def Xform "{name}" (\n    prepend apiSchemas = ["PhysicsArticulationRootAPI"]\n)\n{{',
    ]
    schemas = '(\n        prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]\n    )'
    for link, T in tree.at_zero.items():
        lines += [f'    def Xform "{link}" {schemas}', "    {", f"        float physics:mass = {MASS[0]}"]
        lines += [f"        float3 physics:diagonalInertia = ({', '.join([MASS[1]] * 3)})"]
        lines += _xform(T, "        ")
        for k, shape in enumerate(tree.shapes.get(link, ())):
            lines += _usd_mesh(shape, k)
        if link == tree.tip_on:
            lines += [f'        def Xform "{tree.tip}"', "        {", *_xform(tree.tip_origin, " " * 12), "        }"]
        lines += ["    }"]
    lines += [
        '    def PhysicsFixedJoint "world_fixed"',
        "    {",
        f"        rel physics:body1 = </{name}/{BASE}>",
        "    }",
    ]
    for joint in tree.joints:
        kind, scale = ("Prismatic", 1.0) if joint.kind == "prismatic" else ("Revolute", 180.0 / np.pi)
        over = np.diag([1.0, joint.sign, joint.sign, 1.0])  # the schema's axes have no sign
        at = joint.origin @ over
        limits = [] if joint.limits is None else zip(("lower", "upper"), np.array(joint.limits) * scale, strict=True)
        lines += [
            f'    def Physics{kind}Joint "{joint.name}"',
            "    {",
            '        uniform token physics:axis = "Z"',
            f"        rel physics:body0 = </{name}/{joint.parent}>",
            f"        rel physics:body1 = </{name}/{joint.child}>",
            f"        point3f physics:localPos0 = ({_numbers(at[:3, 3], ', ')})",
            f"        quatf physics:localRot0 = ({_numbers(_quaternion(at), ', ')})",
            "        point3f physics:localPos1 = (0, 0, 0)",
            f"        quatf physics:localRot1 = ({_numbers(_quaternion(over), ', ')})",
            *(f"        float physics:{end}Limit = {float(value)!r}" for end, value in limits),
            "    }",
        ]
    return "\n".join([*lines, "}"]) + "\n"


def _xform(T: Float[np.ndarray, "4 4"], indent: str, scale: Sequence[float] | None = None) -> list[str]:
    ops = ["translate", "orient", *([] if scale is None else ["scale"])]
    listed = ", ".join(f'"xformOp:{op}"' for op in ops)
    return [
        f"{indent}double3 xformOp:translate = ({_numbers(T[:3, 3], ', ')})",
        f"{indent}quatd xformOp:orient = ({_numbers(_quaternion(T), ', ')})",
        *([] if scale is None else [f"{indent}double3 xformOp:scale = ({_numbers(scale, ', ')})"]),
        f"{indent}uniform token[] xformOpOrder = [{listed}]",
    ]


def _usd_mesh(shape: Mesh, number: int) -> list[str]:
    """The triangles of a mesh: USD refers to no files of other forms."""
    corners, index = np.unique(read_triangles(shape.file).reshape(-1, 3), axis=0, return_inverse=True)
    points = ", ".join(f"({x:.7g}, {y:.7g}, {z:.7g})" for x, y, z in corners)
    return [
        f'        def Mesh "visual_{number}"',
        "        {",
        f"            int[] faceVertexCounts = [{', '.join(['3'] * (len(index.ravel()) // 3))}]",
        f"            int[] faceVertexIndices = [{', '.join(map(str, index.ravel().tolist()))}]",
        f"            point3f[] points = [{points}]",
        '            uniform token subdivisionScheme = "none"',
        *_xform(shape.origin, " " * 12, shape.scale),
        "        }",
    ]


_TEXTS: dict[Form, Callable[[Tree, dict[str, None]], str]] = {
    "urdf": urdf_text,
    "mjcf": mjcf_text,
    "sdf": sdf_text,
    "usd": usd_text,
}
