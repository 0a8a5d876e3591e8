"""Robots from models of MuJoCo (MJCF), and which of the two an ``.xml`` file is: that, or a URDF.

MuJoCo itself reads the model, so that its defaults, angles and orders of rotations mean what they mean there. It gets bodies,
joints, sites and couplings alone: no meshes, no plugins, no other files.
"""

from collections.abc import Iterator, Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, shown
from taskcal.geometry import se3
from taskcal.io.xml_file import Element, read_xml
from taskcal.robot.importers.base import RobotImporter
from taskcal.robot.importers.urdf import Mimic, UrdfJoint, UrdfKind, UrdfTree, describe_tree, describe_urdf

_KEPT = {
    "compiler": ("angle", "eulerseq", "autolimits"),
    "equality": (),
    "default": ("class",),
    "worldbody": (),
    "frame": ("name", "pos", "quat", "axisangle", "xyaxes", "zaxis", "euler", "childclass"),
    "body": ("name", "pos", "quat", "axisangle", "xyaxes", "zaxis", "euler", "childclass"),
    "joint": (
        *("name", "class", "type", "pos", "axis", "range", "limited", "ref"),
        *("joint1", "joint2", "polycoef", "active"),  # of a coupling
    ),
    "freejoint": ("name",),
    "site": ("name", "class", "pos", "quat", "axisangle", "xyaxes", "zaxis", "euler"),
}
"""Elements that place something, and their attributes."""

_ELSEWHERE = ("include", "attach", "replicate", "composite", "flexcomp")
"""Elements that stand for others, which may place links."""

_WEIGHT = '<compiler boundmass="1" boundinertia="1"/>'
"""MuJoCo refuses bodies that move and weigh nothing, as they do without their shapes."""


def describe_mjcf(path: Path, **options: Any) -> dict[str, Any]:
    """A robot file's content from a model of MuJoCo, or from a URDF that ends in ``.xml``.

    Bodies and sites are the links; what `describe_urdf` says of links and joints holds.

    Raises:
        FileError: it is neither, it names other files, or the package mujoco is not installed.
        UnknownName: it has no such link.
    """
    root = read_xml(path)
    return describe_urdf(path, **options) if root.tag != "mujoco" else describe_tree(_tree(path, root), **options)


MJCF = RobotImporter(
    name="MuJoCo's MJCF",
    suffixes=(".xml", ".mjcf"),
    options=("tip", "base"),
    describe=lambda path, options: describe_mjcf(path, **options),
)


def _tree(path: Path, root: Element) -> UrdfTree:
    if find_spec("mujoco") is None:
        raise FileError(
            path, "is a model of MuJoCo, which takes the package mujoco: pip install 'taskcal[mujoco]'; or name a URDF"
        )
    mujoco: Any = import_module("mujoco")
    try:
        model = mujoco.MjModel.from_xml_string("".join(_placing(root)))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise FileError(path, f"MuJoCo refuses it: {shown(reason, 200)}") from error
    return _Reader(mujoco, model, path, root).tree()


def _placing(root: Element) -> Iterator[str]:
    """The model without what places nothing, each element in its line, so that MuJoCo names those of the file."""
    at = 1

    def written(element: Element) -> Iterator[str]:
        nonlocal at
        for child in element.children:
            if child.tag in _ELSEWHERE:
                raise child.error(
                    f"has <{child.tag}>, which stands for what is not read; name the robot's own file, or save the model whole "
                    "(mujoco.mj_saveLastXML)"
                )
            if child.tag not in _KEPT:
                continue
            stated = "".join(f" {k}={quoteattr(v)}" for k, v in child.attributes.items() if k in _KEPT[child.tag])
            yield "\n" * (child.line - at) + f"<{child.tag}{stated}>"
            at = max(at, child.line)
            yield from written(child)
            yield f"</{child.tag}>"

    yield f"<mujoco>{_WEIGHT}"
    yield from written(root)
    yield "</mujoco>"


class _Reader:
    """Links and joints of a compiled model."""

    def __init__(self, mujoco: Any, model: Any, path: Path, root: Element):
        self.mujoco, self.model, self.path, self.root = mujoco, model, path, root
        self.lines = {one.attributes.get("name", ""): one.line for one in _all(root) if one.tag == "joint"}
        self.links: list[str] = []
        self.above: dict[str, UrdfJoint] = {}

    def tree(self) -> UrdfTree:
        """The bodies as links, those with several joints in a row with links between them, and sites as links fixed to them."""
        model = self.model
        if not model.njnt:
            raise FileError(self.path, "has no joints; is it a scene that includes the robot's file? Name that one")
        mimics, bodies = self._mimics(), [self._link("body", k) for k in range(model.nbody)]
        self.links.append(bodies[0])
        for k in range(1, model.nbody):
            parent, pending = bodies[model.body_parentid[k]], _pose(model.body_pos[k], model.body_quat[k])
            for j in range(model.body_jntadr[k], model.body_jntadr[k] + model.body_jntnum[k]):
                pending = self._joint(j, parent, pending, mimics)
                parent = self.links[-1]
            self._fix(bodies[k], parent, pending)
        for k in range(model.nsite):
            name = self._link("site", k)
            name = name if name not in self.links else f"{name}_site"
            self._fix(name, bodies[model.site_bodyid[k]], _pose(model.site_pos[k], model.site_quat[k]))
        name = self.root.attributes.get("model", "")
        return UrdfTree(path=self.path, name=name, links=tuple(self.links), above=self.above)

    def _joint(self, j: int, parent: str, pending: Float[np.ndarray, "4 4"], mimics: Mapping[str, Mimic]) -> Any:
        """Hang a joint on a link; returns where its body stands behind it."""
        model, name = self.model, self._link("joint", j)
        kinds: dict[int, UrdfKind] = {3: "revolute", 2: "prismatic"}
        kind = kinds.get(int(model.jnt_type[j]), "floating")
        axis, ref = model.jnt_axis[j].copy(), float(model.qpos0[model.jnt_qposadr[j]])
        to = se3.pose(np.eye(3), model.jnt_pos[j].copy())
        back = se3.pose(np.eye(3), -axis * ref) if kind == "prismatic" else se3.pose(se3.exp(-axis * ref), np.zeros(3))
        low, high = (float(value) for value in model.jnt_range[j])
        self._hang(
            UrdfJoint(
                name=name,
                kind=kind,
                parent=parent,
                child=f"{name} moves",
                origin=pending @ to @ (np.eye(4) if kind == "floating" else back),
                axis=axis,
                limits=(low, high) if model.jnt_limited[j] else None,
                speed=None,
                mimic=mimics.get(name),
                remark="",
                line=self.lines.get(name, self.root.line),
            )
        )
        return se3.inverse(to)

    def _fix(self, link: str, parent: str, origin: Float[np.ndarray, "4 4"]) -> None:
        self._hang(
            UrdfJoint(
                name=f"to {link}",
                kind="fixed",
                parent=parent,
                child=link,
                origin=origin,
                axis=np.array([0.0, 0.0, 1.0]),
                limits=None,
                speed=None,
                mimic=None,
                remark="",
                line=self.root.line,
            )
        )

    def _hang(self, joint: UrdfJoint) -> None:
        self.links.append(joint.child)
        self.above[joint.child] = joint

    def _mimics(self) -> dict[str, Mimic]:
        """Joints that follow others, by the model's equalities.

        Raises:
            FileError: one does by a polynomial.
        """
        model, out = self.model, dict[str, Mimic]()
        for k in range(model.neq):
            a, b = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
            if b < 0 or not model.eq_active0[k]:
                continue
            follower, leader, (offset, ratio, *rest) = (
                self._link("joint", a),
                self._link("joint", b),
                model.eq_data[k, :5],
            )
            if np.any(rest):
                message = (
                    f"joint '{shown(follower)}' follows '{shown(leader)}' by a polynomial, which Taskcal does not read"
                )
                raise FileError(self.path, message, line=self.lines.get(follower, self.root.line))
            refs = [float(model.qpos0[model.jnt_qposadr[j]]) for j in (a, b)]
            out[follower] = Mimic(
                joint=leader, multiplier=float(ratio), offset=float(offset) + refs[0] - ratio * refs[1]
            )
        return out

    def _link(self, kind: str, k: int) -> str:
        """Name of a body, joint or site; one by its number where it has none."""
        named = self.mujoco.mj_id2name(self.model, getattr(self.mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), k)
        return named or f"{kind}_{k}"


def _all(element: Element) -> Iterator[Element]:
    for child in element.children:
        yield child
        yield from _all(child)


def _pose(position: Float[np.ndarray, " 3"], quaternion: Float[np.ndarray, " 4"]) -> Float[np.ndarray, "4 4"]:
    """A pose of the model, whose quaternions begin with their scalar."""
    w, *v = quaternion / np.linalg.norm(quaternion)
    return se3.pose(se3.from_quaternion(np.array([*v, w])), position)
