"""An effect of one's own is one class: once it is defined it competes, is named, saved and loaded."""

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from taskcal.errors import CampaignError, FileError, TaskcalError, UnknownName
from taskcal.identification.calibration import Calibration, load_calibration
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.reading.writer import write_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import (
    Effect,
    EncoderGain,
    Harmonics,
    LinearTerm,
    at_joints,
    candidates,
    effect_from,
    kinds,
    parse_effect,
    spellings,
)
from taskcal.robot.effects import base as registry
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

EXAMPLES = Path(__file__).parents[3] / "examples"
BELT = EXAMPLES / "belt.py"


@pytest.fixture(autouse=True)
def apart(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What a test defines is gone behind it."""
    monkeypatch.setattr(registry, "_KINDS", dict(registry._KINDS))
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield
    sys.modules.pop("belt", None)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """A robot with belts, its campaign, and the calibration that found them, in memory and in files."""
    folder, robot, rng = tmp_path_factory.mktemp("belt"), load_robot("abb-irb120"), np.random.default_rng(0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "_KINDS", dict(registry._KINDS))
        patch.syspath_prepend(EXAMPLES)
        Belt = import_module("belt").Belt
        model = ErrorModel(robot)
        true = model + Belt()
        x = np.zeros(len(true))
        x[-12:] = 4e-4
        campaign, truth = simulate(true, rng.uniform(-1.0, 1.0, (50, 6)), rng=rng, x=x)
        found = explain(model, campaign, candidates=(EncoderGain(), Belt()), folds=3)
    sys.modules.pop("belt", None)
    found.calibration.save(folder / "cal.json")
    write_campaign(folder / "campaign.csv", campaign, robot)
    return SimpleNamespace(found=found, truth=truth, folder=folder, file=folder / "cal.json", campaign=campaign)


def error(calibration: Calibration, truth) -> float:
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (50, 6))
    return float(np.linalg.norm(calibration.predict(q) - truth.points(q), axis=2).mean())


def test_it_competes_and_is_identified(measured):
    assert [stage.name for stage in measured.found.stages if stage.accepted] == ["geometry", "all effects", "belt"]
    assert measured.found.calibration.names[-12:-10] == ("J1.belt_cos", "J2.belt_cos")
    assert [type(effect).__name__ for effect in measured.found.effects] == ["Belt"]
    plain = identify(ErrorModel(measured.truth.model.robot), measured.campaign)
    assert error(measured.found.calibration, measured.truth) < 0.3 * error(plain, measured.truth)


def test_it_is_refused_by_name_until_its_module_is_imported(measured):
    with pytest.raises(
        FileError, match=r"cal\.json: the effect 'Belt' comes from the module 'belt', which is not import"
    ):
        load_calibration(measured.file)
    sys.path.append(str(EXAMPLES))
    kind = import_module("belt").Belt
    again = load_calibration(measured.file)
    assert again.model.effects == (EncoderGain(), kind())
    assert error(again, measured.truth) == error(measured.found.calibration, measured.truth)


def test_a_process_without_it_refuses_the_calibration(measured):
    code = "import sys, taskcal as tc; tc.load_calibration(sys.argv[1])"
    done = subprocess.run([sys.executable, "-c", code, measured.file], capture_output=True, encoding="utf-8")
    assert done.returncode == 1
    assert "the effect 'Belt' comes from the module 'belt', which is not imported" in done.stderr


def test_it_competes_by_default_and_has_a_name_and_a_line(monkeypatch):
    sys.path.append(str(EXAMPLES))
    kind = import_module("belt").Belt
    assert kind in kinds()
    assert kind() in candidates(load_robot("ur5"), Conditions())
    assert parse_effect("belt") == kind()
    assert spellings()["belt"] == kind.summary
    assert kind(joints=("J2", "J3")).name == "belt of J2, J3"


def test_a_class_that_is_defined_again_takes_its_own_place():
    def define(said: str) -> type[Effect]:
        class Wobble(Effect):
            key, label, summary = "wobble", "wobble", said

        return Wobble

    define("first")
    again = define("second")
    assert [kind for kind in kinds() if kind.key == "wobble"] == [again]


def _taken_key():
    class Other(Effect):
        key, label = "gain", "another gain"


def _taken_spelling():
    class Other(Effect):
        key, label = "periodic", "another kind of period"


def _taken_name():
    class Harmonics(Effect):
        key, label = "other", "other"


def _no_key():
    class Other(Harmonics):
        label = "other"


def _no_label():
    class Other(Effect):
        key = "other"


def _unknown_need():
    class Other(Effect):
        key, label, needs = "other", "other", ("humidity",)


@pytest.mark.parametrize(
    ("define", "words"),
    [
        (_taken_key, "cannot be called 'gain': EncoderGain of taskcal.robot.effects.gears is"),
        (_taken_spelling, "cannot be called 'periodic': Harmonics of"),
        (_taken_name, "cannot be called 'Harmonics'"),
        (_no_key, 'Other has no key of its own; write key = "other"'),
        (_no_label, "Other has no label of its own"),
        (_unknown_need, "no quantity 'humidity' that a campaign tells, for Other"),
    ],
)
def test_what_cannot_be_told_apart_is_refused_as_it_is_defined(define, words):
    before = kinds()
    with pytest.raises(TaskcalError, match=words.replace("(", r"\(")):
        define()
    assert kinds() == before


def test_files_name_only_what_is_defined():
    with pytest.raises(UnknownName, match="no effect 'Friction'"):
        effect_from({"kind": "Friction"})
    with pytest.raises(TaskcalError, match="comes from a script or notebook, which is not imported"):
        effect_from({"kind": "Friction", "module": "__main__"})
    with pytest.raises(TaskcalError, match="'friction' is not an effect; known: backlash, compliance"):
        parse_effect("friction")
    assert all("module" not in kind().to_json() for kind in kinds())
    assert [effect_from(kind().to_json()) for kind in kinds()] == [kind() for kind in kinds()]


@dataclass(frozen=True, kw_only=True)
class Drooping(Effect, abstract=True):
    """Joints that droop by the kelvin."""

    def term(self, robot) -> LinearTerm:
        joints = np.arange(len(robot.joints))
        return at_joints(
            [f"{name}.droop" for name in robot.joint_names],
            robot,
            joints,
            [1e-5] * len(joints),
            lambda q: np.zeros(q.shape),
            given=lambda q, conditions: np.cos(q) * (conditions.temperature[:, None] - 20.0),
        )


def test_required_condition_must_be_stated_in_every_row():
    """Every row must state a condition that the effect requires."""

    class Droop(Drooping):
        key, label, needs = "droop", "droop", ("temperature",)

    robot, rng = load_robot("ur5"), np.random.default_rng(0)
    model, q = ErrorModel(robot) + Droop(), rng.uniform(-1.0, 1.0, (40, 6))
    warmth = Conditions(temperature=rng.uniform(18.0, 30.0, 40))
    campaign, truth = simulate(model, q, rng=rng, conditions=warmth)
    found = identify(model, campaign)
    deviation = (found.estimate - truth.x)[-6:] / found.standard_errors[-6:]
    assert np.abs(deviation).max() < 4.0
    assert Droop().is_told(warmth)
    assert not Droop().is_told(Conditions())
    with pytest.raises(CampaignError, match="has no temperatures, which the effect 'droop' needs; add a column temp_C"):
        identify(model, replace(campaign, conditions=Conditions()))


def test_what_it_depends_on_must_be_said():
    class Droop(Drooping):
        key, label = "droop", "droop"

    with pytest.raises(TaskcalError, match="Droop depends on conditions; say which in its class"):
        ErrorModel(load_robot("ur5")) + Droop()


def test_a_model_s_effects_are_fixed():
    model = ErrorModel(load_robot("ur5")) + EncoderGain()
    with pytest.raises(
        AttributeError, match=r"effects of ErrorModel\(ur5: \d+ parameters\) cannot be set; model \+ effect"
    ):
        model.effects = ()
    assert model.effects == (EncoderGain(),)
