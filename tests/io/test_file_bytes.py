"""What files hold, to the byte: whoever changes what is written sees it here."""

from pathlib import Path

import numpy as np

from taskcal.correction.cell import Cell, ExternalAxis, Measured, cell_text
from taskcal.geometry import se3
from taskcal.registration.registration import Registration
from taskcal.registration.registration_file import registration_text
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

STORED = Path(__file__).parent / "stored"
QUARTER = se3.pose(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([0.25, -1.5, 0.125]))
TOUCHED = np.radians([[0.0, -90.0, 90.0], [45.0, 0.0, 0.0], [180.0, 30.0, 0.0]])


def same(name: str, text: str) -> None:
    assert text == (STORED / name).read_text(encoding="utf-8")


def test_cell_file_keeps_its_bytes() -> None:
    tools = (
        Measured(name="Cutter", reflectors={name: np.array([0.125 * k, 0.0, -0.5]) for k, name in enumerate("abc")}),
        Measured(name="probe", controller=se3.translation(0.0, 0.0, 0.25), in_flange=QUARTER, uncertainty=2e-5),
        Measured(name="pen", tip=np.tile(TOUCHED[:1], (4, 1))),
        Measured(name="hand", in_target=QUARTER),
    )
    parts = (
        Measured(name="Fixture", in_tracker=QUARTER, uncertainty=1e-5),
        Measured(name="blade", touched=TOUCHED, touched_with="probe"),
        Measured(name="unknown"),
    )
    axes = (
        ExternalAxis(number=1, carries="robot", slides_along=np.array([0.0, 0.6, 0.8])),
        ExternalAxis(number=2, carries="part", turns_about=np.array([0.0, 0.0, 1.0]), T_frame=QUARTER, unit="STN1"),
        ExternalAxis(number=5, carries="nothing"),
    )
    cell = Cell(
        tools={one.name.casefold(): one for one in tools}, parts={one.name.casefold(): one for one in parts},
        T_world_base=QUARTER, controller="calibrated", axes=axes, data={"XHOME": "{E6POS: X 1}"},
    )  # fmt: skip
    same("cell.toml", cell_text(cell))
    assert not cell_text(Cell())


def test_registration_file_keeps_its_bytes() -> None:
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(0)
    campaign, _ = simulate(model, rng.uniform(-1.0, 1.0, (12, 6)), rng=rng, targets={"ä": np.zeros(3), "b": np.ones(3)})
    found = Registration(
        T_tracker_base=QUARTER, T_tool_target=np.stack([np.eye(4), QUARTER]), rms=2.5e-4, method="circles",
        unobservable=np.diag([0.0, 0.5, 0.0, 0.0, 0.5, 0.0]),
    )  # fmt: skip
    same("registration.json", registration_text(found, model, campaign))
