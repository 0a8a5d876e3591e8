"""Random robots, as the content of robot files, with joint positions and defects that suit them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st

from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.robot.robot_file import robot_from

_IRB6660 = load_robot("abb-irb6660-205-1.9").description

NAMED = ("abb-irb6660-205-1.9", "ur10", "franka-panda")
"""A closed loop, a plain arm and one of seven axes, for what random robots do not have."""

seeds = st.integers(0, 2**32 - 1)
generators = seeds.map(np.random.default_rng)


@dataclass(frozen=True, eq=False)
class Case:
    """A robot where it stands."""

    description: dict[str, Any]
    q: np.ndarray
    """Joint positions (n, joints)."""
    x: np.ndarray
    """Defects, in the model's order."""

    @property
    def robot(self) -> Robot:
        return robot_from(self.description)

    @property
    def model(self) -> ErrorModel:
        return ErrorModel(self.robot)


def _angle(rng: np.random.Generator) -> float:
    return float(rng.choice([0.0, 90.0, -90.0, 180.0, rng.uniform(-180, 180)]))


def _length(rng: np.random.Generator) -> float:
    return float(rng.choice([0.0, *rng.uniform(-800, 800, 3)]))


def _around(rng: np.random.Generator, style: str) -> dict[str, Any]:
    if style == "steps":
        keys = [f"{k}{a}_{'mm' if k == 't' else 'deg'}" for k in "tr" for a in "xyz"]
        chosen = rng.choice(keys, size=rng.integers(1, 4))
        return {"steps": [{k: _length(rng) if k.endswith("mm") else _angle(rng)} for k in map(str, chosen)]}
    return {style: {"alpha_deg": _angle(rng), "a_mm": _length(rng), "d_mm": _length(rng)}}


def _expression(rng: np.random.Generator, i: int, names: list[str]) -> str:
    """A linear coupling of joint i with others, nonsingular over all joints: triangular in the order of the names."""
    own = float(rng.choice([1.0, -1.0, rng.uniform(0.5, 2.0)]))
    text = f"{own:.6f}*{names[i]}"
    if i:
        other = names[int(rng.integers(i))]
        text = str(
            rng.choice(
                [
                    text,
                    f"-({names[i]} + {other})",
                    f"{text} - {rng.uniform(0.1, 1.5):.6f}*{other}",
                    f"{names[i]}/-2 + {other}",
                ]
            )
        )
    return text


@st.composite
def descriptions(draw: st.DrawFn, min_joints: int = 1, max_joints: int = 9, prismatic: bool = True) -> dict[str, Any]:
    """Robot files of any structure: steps, DH and modified DH, sliding joints, couplings, offsets."""
    kinds = st.sampled_from(["revolute", "revolute", "prismatic"] if prismatic else ["revolute"])
    types = draw(st.lists(kinds, min_size=min_joints, max_size=max_joints))
    styles = [draw(st.sampled_from(["steps", "dh", "mdh"])) for _ in types]
    coupled = draw(st.booleans())
    rng = draw(generators)
    names = [f"J{i + 1}" for i in range(len(types))]
    joints = []
    for i, (kind, style) in enumerate(zip(types, styles, strict=True)):
        joint = {"name": names[i], "type": kind, **_around(rng, style)}
        joint["offset_mm" if kind == "prismatic" else "offset_deg"] = (
            _length(rng) if kind == "prismatic" else _angle(rng)
        )
        if coupled:
            joint["angle"] = _expression(rng, i, names)
        joints.append(joint)
    return {"name": "random", "joint": joints, "tool": _around(rng, "steps")["steps"]}


def defects(rng: np.random.Generator, description: dict[str, Any], size: float = 0.1) -> np.ndarray:
    """Values for every parameter of the error model, far larger than real, so that second-order effects show."""
    x = rng.normal(scale=size, size=6 * len(description["joint"]) + (9 if "four_bar" in description else 6))
    if "four_bar" in description:
        x[-3:] *= 0.05  # a loop soon fails to close
    return x


def positions(rng: np.random.Generator, description: dict[str, Any], n: int) -> np.ndarray:
    """Joint positions, radians within ±2, metres within ±0.5."""
    half = [0.5 if joint.get("type") == "prismatic" else 2.0 for joint in description["joint"]]
    return rng.uniform(-1, 1, (n, len(half))) * half


@st.composite
def cases(draw: st.DrawFn, poses: int = 3, **structure: Any) -> Case:
    """Random robots at random poses with large random defects."""
    description = draw(descriptions(**structure))
    rng = draw(generators)
    return Case(description=description, q=positions(rng, description, poses), x=defects(rng, description))


def irb6660_description() -> dict[str, Any]:
    """The reference robot of Gutiérrez et al., with its parallelogram."""
    return {**_IRB6660}


def irb6660_positions(rng: np.random.Generator, n: int) -> np.ndarray:
    """Joint positions of the IRB 6660 well within the reach of its parallelogram, radians."""
    q = rng.uniform(np.radians([-90, -30, 0, -150, -100, -180]), np.radians([90, 60, 60, 150, 100, 180]), (n, 6))
    q[:, 2] = np.clip(q[:, 2], q[:, 1] - np.radians(60), q[:, 1] + np.radians(60))
    return q


@st.composite
def four_bar_cases(draw: st.DrawFn, poses: int = 3) -> Case:
    """The IRB 6660 with random loop lengths, at random poses with random defects."""
    description = irb6660_description()
    rng = draw(generators)
    bar = dict(description["four_bar"])
    for key in ("crank_mm", "rod_mm", "rocker_mm"):
        bar[key] = float(bar[key] * rng.uniform(0.97, 1.03))
    description = {**description, "four_bar": bar}
    return Case(description=description, q=irb6660_positions(rng, poses), x=defects(rng, description))


def industrial(rng: np.random.Generator, name: str = "random-6R") -> dict[str, Any]:
    """A six-axis arm of usual build with random lengths: a robot whose geometry can be measured at its tool."""
    mm = lambda low, high: float(rng.uniform(low, high))  # noqa: E731
    rows = [
        (0.0, 0.0, mm(300, 800), 0.0),
        (-90.0, mm(50, 300), 0.0, -90.0),
        (0.0, mm(400, 1000), 0.0, 0.0),
        (-90.0, mm(50, 250), mm(400, 1000), 0.0),
        (90.0, 0.0, 0.0, 0.0),
        (-90.0, 0.0, mm(80, 250), 180.0),
    ]
    joints = [
        {"name": f"J{i + 1}", "mdh": {"alpha_deg": alpha, "a_mm": a, "d_mm": d}, "offset_deg": offset}
        for i, (alpha, a, d, offset) in enumerate(rows)
    ]
    tool = [{"tx_mm": mm(50, 200)}, {"ty_mm": mm(20, 100)}, {"tz_mm": mm(50, 250)}]
    tolerance = {"translation_mm": 0.5, "rotation_mrad": 0.5}
    return {"name": name, "joint": joints, "tool": tool, "tolerance": tolerance}


def industrial_positions(rng: np.random.Generator, n: int) -> np.ndarray:
    """Poses spread over the arm's reach, radians."""
    half = np.radians([120, 45, 45, 120, 90, 150])
    return rng.uniform(-half, half, (n, 6))


def _joint(name: str, limits: tuple[float, float], steps: list[dict[str, float]], **more: Any) -> dict[str, Any]:
    unit = "mm" if more.get("type") == "prismatic" else "deg"
    return {"name": name, "steps": steps, f"limits_{unit}": list(limits), **more}


FEW_DIRECTIONS: dict[str, dict[str, Any]] = {
    "gantry": {
        "name": "gantry",
        "joint": [
            _joint("E1", (0.0, 3000.0), [{"ry_deg": 90.0}], type="prismatic"),
            _joint("E2", (0.0, 2000.0), [{"ry_deg": -90.0}, {"rx_deg": -90.0}], type="prismatic"),
            _joint("E3", (0.0, 1000.0), [{"rx_deg": 90.0}, {"rx_deg": 180.0}], type="prismatic"),
            _joint("E4", (-180.0, 180.0), [{"tz_mm": 100.0}]),
        ],
    },
    "palletizer": {
        "name": "palletizer",
        "joint": [
            _joint("J1", (-178.0, 178.0), [{"tz_mm": 800.0}]),
            _joint("J2", (-45.0, 80.0), [{"tx_mm": 300.0}, {"rx_deg": -90.0}, {"rz_deg": -90.0}]),
            {"name": "K2", "steps": [{"tx_mm": 1100.0}], "driven": True, "angle": "-J2"},
            _joint("J3", (-17.0, 110.0), [{"rz_deg": 90.0}]),
            {"name": "K3", "steps": [{"tx_mm": 1300.0}], "driven": True, "angle": "-J3"},
            _joint("J4", (-178.0, 178.0), [{"tx_mm": 250.0}, {"rx_deg": -90.0}, {"tz_mm": 200.0}]),
        ],
    },
    "five-axis": {
        "name": "five-axis",
        "joint": [
            _joint("J1", (-170.0, 170.0), [{"tz_mm": 400.0}]),
            _joint("J2", (-90.0, 120.0), [{"tx_mm": 100.0}, {"rx_deg": -90.0}], offset_deg=-90.0),
            _joint("J3", (-150.0, 150.0), [{"tx_mm": 500.0}]),
            _joint("J4", (-120.0, 120.0), [{"tx_mm": 500.0}], offset_deg=90.0),
            _joint("J5", (-180.0, 180.0), [{"rx_deg": 90.0}, {"tz_mm": 150.0}]),
        ],
    },
}
"""Robots that command fewer than six directions: a gantry whose wrist turns, a palletizer whose rods keep the tool level, an arm of
five axes."""
