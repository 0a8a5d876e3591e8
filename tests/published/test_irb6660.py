"""What is published of the IRB 6660's parameters, and what its model says under the same placement."""

import re
from pathlib import Path

import numpy as np
import pytest

from taskcal.analysis.identifiability import identifiability, published_kept
from taskcal.analysis.sensitivity import sensitivity
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.mechanism import analyse_mechanism
from taskcal.task.task import reach_task
from taskcal_demo.procedure import reference_task

ELIMINATION = Path(__file__).parents[2] / "docs/theory/elimination.md"

# Gutiérrez, Chanal, Durieux, Duc: sections 2, 3 and 4
REDUNDANT = ["t2z", "t3z", "t4z", "t5z", "t6z", "tbx", "tby", "tbz", "psi5"]
LEFT_OUT = ["t2z", "t3z", "t4z", "t5z", "t6z", "tbx", "tby", "tbz", "alf6", "tib", "psib", "alfb"]


@pytest.fixture(scope="module")
def model():
    return ErrorModel(load_robot("abb-irb6660-205-1.9"))


@pytest.fixture(scope="module")
def one(model):
    return reach_task(model, reference_task(), 60).q


@pytest.fixture(scope="module")
def several(model):
    return reach_task(model, reference_task(np.radians(20.0)), 60).q


def symbols(model, names):
    return {p.symbol for p in model.parameters if p.name in set(names)}


def test_the_mechanism_is_overconstrained_to_degree_three(model):
    found = analyse_mechanism(model.robot)
    assert (found.overconstraint, found.mobility) == (3, 6)
    assert (len(found.motorised), found.passive) == (6, ("J7", "J8", "J9"))


def test_irb6660_keeps_33_of_45_parameters(model):
    """Forty five parameters and the thirty three that were kept."""
    assert len(model) == 45
    assert symbols(model, model.robot.published.redundant) == set(REDUNDANT)
    assert symbols(model, set(model.names) - set(published_kept(model))) == set(LEFT_OUT)
    assert len(published_kept(model)) == 33


def test_each_published_redundant_parameter_is_redundant(model, several):
    """Dropping all of them, and alf6 for psi5, takes nothing from the rank."""
    J = model.jacobian(several, angular=False).reshape(-1, len(model))
    J = J / np.maximum(np.linalg.norm(J, axis=0), 1e-12)
    kept = model.indices(published_kept(model))
    rank = np.linalg.matrix_rank(J, tol=1e-9 * np.linalg.norm(J, 2))
    assert np.linalg.matrix_rank(J[:, kept], tol=1e-9 * np.linalg.norm(J, 2)) == rank == 25


def test_elimination_finds_17_dependent_and_3_zero(model, several):
    """Full elimination finds seventeen dependent and three without effect."""
    found = identifiability(model, several)
    assert found.agrees
    assert (len(found.dependent), len(found.zero), len(found.kept)) == (17, 3, 25)
    assert found.gap > 1e6
    assert symbols(model, found.zero) == {"tib", "psib", "alfb"}


@pytest.mark.parametrize("poses", ["one", "several"])
def test_exact_repeats_are_the_publication_s_nine_and_two_more(model, poses, request):
    """psi5 and alf6 repeat each other: the publication names the one, elimination the other."""
    found = identifiability(model, request.getfixturevalue(poses))
    listed = (set(REDUNDANT) - {"psi5"}) | {"alf6"}
    assert symbols(model, found.repeats) == listed | {"alf5", "L3"}
    assert (len(found.repeats), len(REDUNDANT)) == (11, 9)


@pytest.mark.parametrize(("poses", "smallest"), [("one", 2.3e-4), ("several", 2.0e-3)])
def test_singular_values_at_the_cut_are_as_quoted(model, poses, smallest, request):
    """The singular values about the cut are those that the theory page quotes."""
    found = identifiability(model, request.getfixturevalue(poses))
    s = found.singular_values / found.singular_values[0]
    assert f"{s[found.rank - 1]:.1e}" == f"{smallest:.1e}"
    assert s[found.rank] < 1e-12
    quoted = re.findall(r"\$([\d.]+)\\cdot10\^\{(-\d)\}\$", ELIMINATION.read_text(encoding="utf-8"))
    assert smallest in [float(f"{digits}e{power}") for digits, power in quoted]


def test_exact_repeats_that_the_publication_does_not_list(model, several):
    found = identifiability(model, several)
    assert found.repeats["J5.rz"] == ("J4.ry", pytest.approx(-1.0))
    assert found.repeats["loop.rocker"] == ("loop.crank", pytest.approx(-1.0))
    assert found.repeats["J6.rz"] == ("J5.ry", pytest.approx(1.0))


def test_every_relation_holds_at_every_pose(model, several):
    found = identifiability(model, several)
    J = model.jacobian(several, angular=False)
    for name, terms in found.dependent.items():
        combined = sum(c * J[:, :, model.names.index(other)] for other, c in terms.items())
        np.testing.assert_allclose(combined, J[:, :, model.names.index(name)], atol=1e-9)


def test_one_orientation_loses_one_more_direction(model, one):
    found = identifiability(model, one)
    assert found.agrees
    assert len(found.kept) == 24


def test_the_tracker_frame_adds_four_directions_in_general(model, several):
    alone, with_frames = identifiability(model, several), identifiability(model, several, frames=True)
    assert with_frames.rank - alone.rank == 4
    assert with_frames.dependent["base.rz"] == {"J1.rz": pytest.approx(1.0)}
    assert with_frames.dependent["base.tz"] == {"J1.tz": pytest.approx(1.0)}


def test_rotations_move_the_tool_by_the_length_of_their_lever(model, one):
    found = sensitivity(model, one)
    reach = found.maximum_in_space()[model.names.index("J1.rz")]
    points = np.linalg.norm(model.poses(one)[:, :2, 3], axis=1)
    assert reach == pytest.approx(points.max(), rel=1e-12)


def test_in_one_orientation_the_tracker_frame_adds_two(model, one):
    assert identifiability(model, one, frames=True).rank - identifiability(model, one).rank == 2
