import numpy as np
import pytest
from hypothesis import given, settings

from taskcal.errors import ClosureError, UnknownName
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, EncoderGain
from taskcal.robot.error_model import COMPONENTS, ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal_demo.true_robot import elastic_model
from tests.laws import plain
from tests.laws.robots import NAMED, cases, four_bar_cases, irb6660_description, irb6660_positions

ANY = {"with loop": four_bar_cases(), "without loop": cases()}


def close(actual, desired, relative=1e-10):
    np.testing.assert_allclose(actual, desired, rtol=relative, atol=relative * (1 + np.abs(desired).max(initial=0)))


@pytest.mark.parametrize("kind", ANY)
def test_poses_are_the_product_with_error_frames(kind):
    """Poses are the plain product with an error frame behind each joint and the tool."""

    @given(ANY[kind])
    def law(case):
        close(case.model.poses(case.q, case.x), plain.poses(case.description, case.q, case.x))
        close(case.model.poses(case.q), plain.poses(case.description, case.q))

    law()


@pytest.mark.parametrize("kind", ANY)
def test_jacobian_is_the_derivative_of_the_poses(kind):
    @settings(max_examples=8)
    @given(ANY[kind])
    def law(case):
        model = case.model
        for x in (case.x, np.zeros(len(model))):
            J = model.jacobian(case.q, x)
            for row, q in enumerate(case.q):
                dT = plain.derivatives(lambda v, q=q: plain.pose(case.description, q, v), x)
                close(J[row], plain.twists(plain.pose(case.description, q, x), dT), 1e-9)
            np.testing.assert_array_equal(model.jacobian(case.q, x, angular=False), J[:, :3])

    law()


def test_sensitivities_are_written_where_one_says():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.random.default_rng(0).uniform(-0.3, 0.3, (20_000, 6))
    first = model.jacobian(q, angular=False)
    kept = first.copy()
    assert model.jacobian(q[::-1], angular=False, out=first) is first
    np.testing.assert_array_equal(first, kept[::-1])
    lengths = ErrorModel(model.robot, lengths_only=True)
    part = np.full((5, 6, len(lengths)), np.nan)
    np.testing.assert_array_equal(lengths.jacobian(q[:5], out=part), lengths.jacobian(q[:5]))


@pytest.mark.parametrize("kind", ANY)
def test_joint_jacobian_is_the_derivative_by_joints(kind):
    """Joint jacobian is the derivative by the controller's joints."""

    @given(ANY[kind])
    def law(case):
        J = case.model.joint_jacobian(case.q, case.x)
        for row, q in enumerate(case.q):
            dT = plain.derivatives(lambda v: plain.pose(case.description, v, case.x), q)
            close(J[row], plain.twists(plain.pose(case.description, q, case.x), dT), 1e-9)

    law()


@given(cases())
def test_parameters_are_six_a_joint_then_six_of_the_tool(case):
    joints = [joint["name"] for joint in case.description["joint"]]
    model = case.model
    assert list(model.names) == [f"{frame}.{c}" for frame in [*joints, "tool"] for c in COMPONENTS]
    assert [p.unit for p in model.parameters] == ["m", "m", "m", "rad", "rad", "rad"] * (len(joints) + 1)


def test_irb6660_has_the_published_45_parameters():
    """The IRB 6660 has the publication's 45 parameters under its symbols."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    per_joint = [f"{s.format(j)}" for j in range(1, 7) for s in ("t{}x", "t{}y", "t{}z", "ti{}", "psi{}", "alf{}")]
    expected = [*per_joint, "tbx", "tby", "tbz", "tib", "psib", "alfb", "L1", "L2", "L3"]
    assert len(model) == 45
    assert [p.symbol for p in model.parameters] == expected
    assert model.names[-3:] == ("loop.crank", "loop.rod", "loop.rocker")
    assert model.names[model.indices(["psi5"])[0]] == "J5.ry"


def lengths_pose(x, q):
    """The nominal robot of the publication with its six lengths changed."""
    description = irb6660_description()
    symbols = ("RL1", "d2", "d3", "d4", "RL4", "RL6")

    def changed(step):
        if "symbol" not in step:
            return step
        (key,) = set(step) - {"symbol"}
        return {key: step[key] + 1e3 * x[symbols.index(step["symbol"])], "symbol": step["symbol"]}

    joints = [{**j, "steps": [changed(step) for step in j["steps"]]} for j in description["joint"]]
    return plain.pose({**description, "joint": joints}, q)


def test_lengths_model_has_the_published_six():
    """The model of nominal lengths has the publication's six and their derivatives."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"), lengths_only=True)
    assert model.names == ("RL1", "d2", "d3", "d4", "RL4", "RL6")
    assert {p.unit for p in model.parameters} == {"m"}
    rng = np.random.default_rng(0)
    q, x = irb6660_positions(rng, 10), rng.normal(scale=0.05, size=6)
    close(model.poses(q, x), [lengths_pose(x, row) for row in q])
    J = model.jacobian(q, x)
    for row in range(10):
        dT = plain.derivatives(lambda v, row=row: lengths_pose(v, q[row]), x)
        close(J[row], plain.twists(lengths_pose(x, q[row]), dT))


@pytest.mark.parametrize("name", NAMED)
def test_lengths_model_has_a_column_per_length(name):
    """The model of lengths has a column for every length of a catalogue robot."""
    model = ErrorModel(load_robot(name), lengths_only=True)
    assert len(model) > 0
    J = model.jacobian(np.zeros((1, len(model.robot.joints))))
    np.testing.assert_allclose(np.linalg.norm(J[0, :3], axis=0), 1.0, rtol=1e-12)
    assert not J[0, 3:].any()


def test_parameters_are_found_by_name_symbol_and_joint():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))

    def named(*names):
        return [model.names[i] for i in model.indices(names)]

    assert named("J3.tx") == ["J3.tx"]
    assert named("alf6", "t1x") == ["J1.tx", "J6.rz"]
    assert named("J2") == [f"J2.{c}" for c in COMPONENTS]
    assert named("tool", "tool.tx") == [f"tool.{c}" for c in COMPONENTS]
    assert named("loop") == ["loop.crank", "loop.rod", "loop.rocker"]
    assert named() == []


@pytest.mark.parametrize("name", ["J7.tx", "J7", "", "J1.", "t9x", "j1.tx"])
def test_an_unknown_parameter_is_named_with_what_the_robot_has(name):
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    with pytest.raises(
        UnknownName, match=rf"no parameter '{name}'.*joint frames run from J1 to J6, then tool and loop"
    ):
        model.indices([name])


def test_tolerances_are_the_files_by_kind_or_by_name():
    description = irb6660_description()
    description["tolerance"] = {
        "translation_mm": 0.2,
        "rotation_mrad": 0.3,
        "length_mm": 0.4,
        "parameter_mm": {"J2.tx": 1.5},
        "parameter_mrad": {"J3.rz": 2.5},
    }
    by_name = {p.name: p.tolerance for p in ErrorModel(robot_from(description)).parameters}
    expected = {"J1.tx": 0.2e-3, "J1.rx": 0.3e-3, "loop.rod": 0.4e-3, "J2.tx": 1.5e-3, "J3.rz": 2.5e-3}
    for name, value in expected.items():
        assert by_name[name] == pytest.approx(value)


def test_a_tolerance_of_no_parameter_is_refused():
    description = irb6660_description()
    description["tolerance"] = {"parameter_mm": {"J9.tx": 1.0}}
    with pytest.raises(UnknownName, match=r"no parameter 'J9\.tx'.*a tolerance of abb-irb6660-205-1\.9"):
        ErrorModel(robot_from(description))


def test_a_loop_that_cannot_close_names_the_pose():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.zeros((4, 6))
    q[2, 2] = np.radians(95)
    x = np.zeros(45)
    x[model.indices(["loop.rod"])] = 0.2
    for call in (model.poses, model.jacobian, model.joint_jacobian):
        with pytest.raises(ClosureError, match="pose 2"):
            call(q, x)


@pytest.mark.parametrize("shape", [(3, 5), (3, 7)])
def test_joints_of_another_shape_are_refused(shape):
    model = ErrorModel(load_robot("ur5"))
    with pytest.raises(ValueError, match=r"q has shape \(3, .\); ur5 needs \(n, 6\), in radians"):
        model.poses(np.zeros(shape))


def test_parameters_of_another_number_are_refused():
    model = ErrorModel(load_robot("ur5"))
    with pytest.raises(ValueError, match=r"x has shape \(41,\).*needs \(42,\)"):
        model.poses(np.zeros((1, 6)), np.zeros(41))


@pytest.mark.parametrize("name", NAMED)
def test_defects_move_the_next_axis_not_the_first(name):
    """The defects of a joint follow its motion: joint 1 turns the tool about its nominal axis, whatever they are."""
    model, rng = ErrorModel(load_robot(name)), np.random.default_rng(0)
    q, x = (
        rng.uniform(*0.2 * model.robot.limits.T, (3, len(model.robot.joint_names))),
        rng.normal(size=len(model)) * 0.005,
    )

    def turned(joint, defects):
        step = 0.01 * np.eye(q.shape[1])[joint]
        return model.poses(q + step, defects) @ np.linalg.inv(model.poses(q, defects))

    close(turned(0, x), turned(0, 0.0 * x), 1e-9)
    for joint in range(1, q.shape[1]):
        assert np.abs(turned(joint, x) - turned(joint, 0.0 * x)).max() > 1e-6


def test_nominal_model_drops_idle_effects():
    """The nominal model has no effect that is nothing there and the same poses."""
    model = elastic_model(load_robot("abb-irb6660-205-1.9")) + EncoderGain()
    q = np.random.default_rng(0).uniform(-0.3, 0.3, (5, 6))
    sag = next(effect for effect in model.effects if isinstance(effect, Compliance))
    assert model.nominal.effects == (sag,)
    assert model.nominal.nominal is model.nominal
    np.testing.assert_allclose(model.poses(q), model.poses(q, np.zeros(len(model))), rtol=0, atol=1e-14)
    assert np.abs(model.poses(q) - ErrorModel(model.robot).poses(q)).max() > 1e-4
