"""What every peer calibrates: rows to fit, rows to check, the nominal chain as each of them reads it, and a start."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

import taskcal as tc
from taskcal.campaigns.campaign import Campaign
from taskcal.export.descriptions import Tree, urdf_text
from taskcal.export.forms import CalibratedChain, fit_table
from taskcal.registration.registration import register
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.joint_side import JointMap
from taskcal.robot.robot_file import robot_from

FITTED = 60
HELD_OUT = 200
REFLECTOR = np.array([0.05, 0.03, 0.10])
"""Of the virtual robots, in the tool frame, metres: beside every axis."""
IRB6660_POSTURE = np.radians([0.0, 10.0, 40.0, 10.0, 45.0, 20.0])
"""Poses are drawn within 20° of it, where the four-bar closes."""
MAX_JOINTS = 50
"""Of a robot file; a longer chain is put together of two, which no file can hold."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """One robot and its rows. Chain coordinates are what turns in a serial chain; all else about the drive is done beforehand."""

    name: str
    title: str
    model: ErrorModel
    fitted: Campaign
    q_held: Float[np.ndarray, "m joints"]
    points_held: Float[np.ndarray, "m 3"]
    """In the tracker frame, metres: measured, or true where the robot is virtual."""

    def write(self, folder: Path) -> None:
        """Files that an adapter reads: ``case.npz`` and the nominal robot as ``robot.urdf``; all in metres and radians."""
        serial = serial_chain(self.model, self.fitted.q)
        table = fit_table(serial, "mdh")
        start = register(self.model, self.fitted)
        joint_map = self.model.robot.joint_map
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "robot.urdf").write_text(urdf_text(Tree.of(serial)), encoding="utf-8")
        np.savez(
            folder / "case.npz",
            robot=self.model.robot.name,
            q=self.fitted.q,
            q_held=self.q_held,
            chain_q=joint_map(self.fitted.q),
            chain_q_held=joint_map(self.q_held),
            points=self.fitted.points[:, 0],
            points_held=self.points_held,
            before=np.stack([joint.before for joint in serial.joints]),
            end=serial.end,
            mdh=table.rows,
            mdh_base=table.base,
            mdh_tool=table.tool,
            start_base=start.T_tracker_base,
            start_target=start.T_tool_target[0, :3, 3],
        )


def serial_chain(model: ErrorModel, q: Float[np.ndarray, "n joints"]) -> CalibratedChain:
    """The nominal chain with its own coordinates for joints."""
    chain = CalibratedChain.of_model(model, np.zeros(len(model)), q)
    return replace(chain, matrix=np.eye(len(chain.joints)), offset=np.zeros(len(chain.joints)))


def virtual_case(name: str, title: str, model: ErrorModel, q: Float[np.ndarray, "n joints"], seed: int = 0) -> Case:
    """A robot with defects drawn from its tolerances; the last rows are held out and compared with the truth."""
    rng = np.random.default_rng(seed)
    fitted = q[: len(q) - HELD_OUT]
    campaign, truth = tc.simulate(model, fitted, rng=rng, targets={"smr": REFLECTOR})
    held = q[len(fitted) :]
    return Case(name=name, title=title, model=model, fitted=campaign, q_held=held, points_held=truth.points(held)[:, 0])


def ur10(count: int = FITTED) -> Case:
    """A virtual UR10, joints anywhere within half their range."""
    model = ErrorModel(tc.load_robot("ur10"))
    q = np.random.default_rng(1).uniform(*0.25 * model.robot.limits.T, size=(count + HELD_OUT, 6))
    return virtual_case("ur10", "UR10, virtual", model, q)


def irb6660(count: int = FITTED) -> Case:
    """A virtual IRB 6660, its parallelogram with defects too."""
    model = ErrorModel(tc.load_robot("abb-irb6660-205-1.9"))
    spread = np.random.default_rng(2).uniform(-1.0, 1.0, size=(count + HELD_OUT, 6))
    q = IRB6660_POSTURE + np.radians(20.0) * spread
    return virtual_case("irb6660", "IRB 6660, virtual, four-bar", model, q)


def irb120(data: Path) -> Case:
    """Measured rows of an IRB 120, first reflector; one random split.

    Raises:
        FileNotFoundError: the folder of measured robots has no ``irb120_faro``.
    """
    model = ErrorModel(tc.load_robot("abb-irb120"))
    campaign = read_irb120(data, model)
    order = np.random.default_rng(0).permutation(len(campaign))
    held = campaign.take(order[FITTED:])
    fitted = campaign.take(order[:FITTED])
    title = f"IRB 120, {len(fitted)} of {len(campaign)} measured rows"
    return Case(name="irb120", title=title, model=model, fitted=fitted, q_held=held.q, points_held=held.points[:, 0])


def read_irb120(data: Path, model: ErrorModel) -> Campaign:
    """The first reflector of the measured IRB 120, rows with a lost beam left out."""
    campaign = tc.read_campaign(data / "irb120_faro" / "measurements.csv", model.robot).of_targets(["smr1"])
    return campaign.take(campaign.valid[:, 0])


def chain_model(joints: int, rng: np.random.Generator) -> ErrorModel:
    """A serial chain of as many turning joints, for cost against parameters: six for each joint and six for the tool."""
    if joints <= MAX_JOINTS:
        return ErrorModel(robot_from(_described(joints, rng)))
    pieces = [robot_from(_described(count, rng)) for count in (MAX_JOINTS, joints - MAX_JOINTS)]
    named = (replace(joint, name=f"J{k}") for k, joint in enumerate((j for p in pieces for j in p.joints), start=1))
    straight = JointMap(matrix=np.eye(joints), offset=np.zeros(joints))
    return ErrorModel(replace(pieces[0], joints=tuple(named), joint_map=straight))


def random_chain(joints: int, count: int, seed: int = 0) -> Case:
    """Rows of such a chain."""
    rng = np.random.default_rng(seed)
    model = chain_model(joints, rng)
    q = rng.uniform(-1.0, 1.0, size=(count + HELD_OUT, joints))
    return virtual_case(f"chain-{joints}", f"chain of {joints} joints", model, q)


def _described(joints: int, rng: np.random.Generator) -> dict[str, object]:
    """As a robot file says it."""
    return {
        "name": f"chain-{joints}",
        "joint": [
            {
                "name": f"J{k + 1}",
                "mdh": {
                    "alpha_deg": float(rng.choice([-90.0, 90.0])),
                    "a_mm": float(rng.uniform(20.0, 100.0)),
                    "d_mm": float(rng.uniform(20.0, 100.0)),
                },
                "limits_deg": [-90.0, 90.0],
            }
            for k in range(joints)
        ],
    }


def main_cases(data: Path | None) -> Mapping[str, Case | str]:
    """The three robots by name; a sentence in place of one that is not there."""
    measured: Case | str = "no folder of measured robots; name it with --data or TASKCAL_DATA"
    if data is not None and (data / "irb120_faro").is_dir():
        measured = irb120(data)
    return {"ur10": ur10(), "irb120": measured, "irb6660": irb6660()}
