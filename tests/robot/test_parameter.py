"""Units in which parameters are shown."""

import numpy as np
import pytest

from taskcal.analysis.sensitivity import sensitivity
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Backlash, Compliance, EncoderGain, Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.parameter import ShownUnit


@pytest.mark.parametrize(
    ("si", "name", "factor", "key", "influence"),
    [
        ("m", "mm", 1e3, "mm", "mm/mm"),
        ("rad", "mrad", 1e3, "mrad", "mm/mrad"),
        ("rad/rad", "mrad/rad", 1e3, "mrad_per_rad", "mm/(mrad/rad)"),
        ("rad/m", "mrad/m", 1e3, "mrad_per_m", "mm/(mrad/m)"),
        ("rad/Nm", "µrad/Nm", 1e6, "urad_per_nm", "mm/(µrad/Nm)"),
        ("m/N", "µm/N", 1e6, "um_per_n", "mm/(µm/N)"),
        ("m/m/K", "µm/m/K", 1e6, "um_per_m_per_k", "mm/(µm/m/K)"),
    ],
)
def test_units(si, name, factor, key, influence):
    unit = ShownUnit.of(si)
    assert (unit.name, unit.factor, unit.key, unit.influence) == (name, factor, key, influence)


def test_parameters_of_effects_have_their_units():
    model = ErrorModel(load_robot("ur5")) + Compliance() + Harmonics(orders=(1,)) + EncoderGain() + Backlash()
    shown = {p.name: p.shown.name for p in model.parameters}
    names = ("J2.tx", "J2.rx", "J2.sag_tool", "J2.cos1", "J2.gain", "J2.backlash")
    assert [shown[name] for name in names] == ["mm", "mrad", "mrad/m", "mrad", "mrad/rad", "mrad"]


def test_influences_are_millimetres_for_one_shown_unit():
    model = ErrorModel(load_robot("ur5")) + Compliance() + EncoderGain()
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (20, 6))
    frame = sensitivity(model, q).to_frame().set_index("parameter")
    for name in ("J2.tx", "J2.rx", "J2.sag_tool", "J2.gain"):
        k = model.names.index(name)
        x = np.zeros(len(model))
        x[k] = 1e-2 / model.parameters[k].shown.factor
        moved = np.abs(model.poses(q, x) - model.poses(q, -x))[:, :3, 3].max(axis=0) / 2e-2 * 1e3
        np.testing.assert_allclose(frame.loc[name, ["max_x", "max_y", "max_z"]].astype(float), moved, rtol=1e-5)
