"""What a URDF's links look like: which mesh each has, where on the link, and where the links are at some joint positions."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, shown
from taskcal.geometry import se3
from taskcal.io.xml_file import Element, parse_xml, read_xml
from taskcal.robot.importers.urdf import (
    UrdfJoint,
    UrdfTree,
    parse_urdf_tree,
    placed_at,
    plain_joint_names,
    read_urdf_tree,
    triple_of,
)
from taskcal.robot.importers.xacro import expand_xacro

XACRO = ".xacro"

MOST_VISUALS = 200
"""Of a robot; the most detailed ones of the field have sixty."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Visual:
    """A mesh on a link."""

    link: str
    origin: Float[np.ndarray, "4 4"]
    """Pose of the mesh in the link, metres."""
    scale: tuple[float, float, float]
    file: str
    """As the URDF names it, such as ``package://robot/meshes/link_1.stl``."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Looks:
    """A URDF's tree with the meshes on it."""

    tree: UrdfTree
    visuals: tuple[Visual, ...]

    def link_poses(self, joints: Mapping[str, float]) -> dict[str, Float[np.ndarray, "4 4"]]:
        """Poses of all links in the root.

        Args:
            joints: positions by joint, as Taskcal names them, radians or metres; joints that are not named are at zero, and those
                that mimic another one follow it.
        """
        every = self.tree.joints
        names = plain_joint_names(self.tree)

        def value(name: str) -> float:
            mimic = every[name].mimic
            if mimic is None:
                return joints.get(names[name], 0.0)
            return mimic.multiplier * value(mimic.joint) + mimic.offset

        poses: dict[str, np.ndarray] = {self.tree.root: np.eye(4)}
        for link in self.tree.links:
            for joint in self.tree.path_to(link):
                if joint.child not in poses:
                    poses[joint.child] = poses[joint.parent] @ joint.origin
                    if joint.moves:
                        poses[joint.child] = poses[joint.child] @ _moved(joint, value(joint.name))
        return poses


def _moved(joint: UrdfJoint, value: float) -> Float[np.ndarray, "4 4"]:
    if joint.kind == "prismatic":
        return se3.pose(np.eye(3), joint.axis * value)
    return se3.pose(se3.exp(joint.axis * value), np.zeros(3))


def read_looks(path: Path) -> Looks:
    """The meshes of a URDF or xacro file.

    Raises:
        FileError: it is not such a file, or has too many of them.
    """
    if path.suffix.lower() == XACRO:
        content = expand_xacro(path)
        root, tree = parse_xml(path, content), parse_urdf_tree(path, content)
    else:
        root, tree = read_xml(path), read_urdf_tree(path)
    visuals = tuple(visual for link in root.all("link") for visual in _visuals(path, link))
    if len(visuals) > MOST_VISUALS:
        raise FileError(path, f"has {len(visuals)} meshes; up to {MOST_VISUALS} are drawn")
    return Looks(tree=tree, visuals=visuals)


def _visuals(path: Path, link: Element) -> list[Visual]:
    found: list[Visual] = []
    for visual in link.all("visual"):
        geometry = visual.first("geometry")
        mesh = None if geometry is None else geometry.first("mesh")
        if mesh is None or not mesh.attributes.get("filename"):
            continue
        found.append(
            Visual(
                link=link.attributes["name"],
                origin=placed_at(path, visual.first("origin"), f"a mesh of link '{shown(link.attributes['name'])}'"),
                scale=triple_of(path, mesh, "scale", (1.0, 1.0, 1.0)),
                file=mesh.attributes["filename"],
            )
        )
    return found
