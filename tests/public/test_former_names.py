"""What had another name in the release before is still understood, and says what it is called now."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taskcal import analysis
from taskcal.analysis.identifiability import eliminate
from taskcal.campaigns.campaign import Campaign
from taskcal.errors import UnknownName
from taskcal.identification.calibration import load_calibration
from taskcal.identification.identify import identify
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import campaign_text
from taskcal.registration.registration import register
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import Overshoot, Thermal, parse_effect
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

ROBOT = load_robot("ur5")


def drawn(model: ErrorModel, count: int = 40) -> Campaign:
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.5, 1.5, size=(count, 6))
    move = rng.uniform(-1.0, 1.0, size=q.shape)
    conditions = Conditions(approach=np.sign(move), move=move, temperature=rng.uniform(18.0, 28.0, size=count))
    return simulate(model, q, rng=rng, conditions=conditions)[0]


def test_nests_are_reference_points_now(tmp_path: Path) -> None:
    plain = drawn(ErrorModel(ROBOT))
    places = {"post": np.tile([1.0, 2.0, 0.5], (len(plain), 1))}
    shared = {"ids": plain.ids, "q": plain.q, "targets": plain.targets, "points": plain.points}
    with pytest.warns(DeprecationWarning, match="'nests' is called 'reference_points' now"):
        campaign = Campaign(**shared, nests=places)  # pyright: ignore
    with pytest.warns(DeprecationWarning, match=r"Campaign\.nests is called 'reference_points' now"):
        assert campaign.nests is campaign.reference_points is places
    (tmp_path / "c.csv").write_text(campaign_text(campaign, ROBOT))
    with pytest.warns(DeprecationWarning, match="'nests' is called 'reference_points' now"):
        again = read_campaign(tmp_path / "c.csv", ROBOT, nests=["post"])  # pyright: ignore[reportCallIssue]
    assert (again.targets, list(again.reference_points)) == (("tool",), ["post"])


def test_what_poses_do_not_observe_has_its_former_name() -> None:
    model = ErrorModel(ROBOT)
    found = register(model, drawn(model))
    with pytest.warns(DeprecationWarning, match=r"Registration\.unlocated is called 'unobservable' now"):
        assert found.unlocated is found.unobservable


def test_an_effect_is_named_by_its_former_key() -> None:
    with pytest.warns(DeprecationWarning, match="the effect 'overrun' is called 'overshoot' now"):
        assert parse_effect("overrun") == parse_effect("overshoot") == Overshoot()


@pytest.mark.parametrize(
    ("effect", "former", "present"),
    [(Overshoot(), "J2.overrun", "J2.overshoot"), (Thermal(), "thermal.growth", "thermal.expansion")],
)
def test_a_parameter_is_found_by_its_former_name(effect, former: str, present: str) -> None:
    model = ErrorModel(ROBOT) + effect
    with pytest.warns(DeprecationWarning, match=f"the parameter '{former}' is called '{present}' now"):
        assert model.indices([former]) == model.indices([present])
    with pytest.raises(UnknownName, match=r"J2\.overran"):
        model.indices(["J2.overran"])


@pytest.mark.parametrize("effect", [Overshoot(), Thermal(joints=("J2", "J3"))])
def test_a_calibration_file_of_an_earlier_release_is_read(effect, tmp_path: Path) -> None:
    model = ErrorModel(ROBOT) + effect
    fit = identify(model, drawn(model), model_error=5e-5, prior_scale=1.0)
    path = tmp_path / "cal.json"
    fit.save(path)
    text = path.read_text(encoding="utf-8")
    former = text.replace("Overshoot", "Overrun").replace(".overshoot", ".overrun").replace(".expansion", ".growth")
    assert former != text
    path.write_text(former, encoding="utf-8")
    read = load_calibration(path)
    assert read.names == fit.names
    assert read.model.effects == fit.model.effects
    np.testing.assert_array_equal(read.z, fit.z)
    data = json.loads(former)
    assert any(name.endswith((".overrun", ".growth")) for name in data["names"])


def test_a_campaign_takes_single_conditions_as_it_once_did() -> None:
    campaign = drawn(ErrorModel(ROBOT), 6)
    shared = {name: getattr(campaign, name) for name in ("ids", "q", "targets", "points")}
    warm, move = np.arange(6.0), np.ones((6, 6))
    with pytest.warns(
        DeprecationWarning, match=r"'temperature' is called 'conditions=Conditions\(temperature=…\)' now"
    ):
        made = Campaign(**shared, temperature=warm, move=move)  # pyright: ignore
    assert made.conditions.temperature is warm
    assert made.move is move
    with pytest.warns(DeprecationWarning, match="'time' is called"):
        assert replace(made, time=warm).conditions.temperature is warm  # pyright: ignore
    with pytest.raises(TypeError, match="temperatur"):
        Campaign(**shared, temperatur=warm)  # pyright: ignore


def test_near_dependences_are_collinearities_now() -> None:
    columns = np.array([[1.0, 1.0, 0.0], [0.0, 1e-3, 1.0]])
    with pytest.warns(DeprecationWarning, match=r"'collinear' now"):
        former = eliminate(columns, ("a", "b", "c"), np.ones(3), 1).near(level=0.99)
    assert [c.name for c in former] == [c.name for c in eliminate(columns, ("a", "b", "c"), np.ones(3), 1).collinear()]
    assert former
    with pytest.warns(DeprecationWarning, match=r"taskcal\.analysis\.Collinearity now"):
        assert analysis.NearDependence is analysis.Collinearity
