"""Lines and arcs in pieces: the true tool meets every node, and keeps to the path between them."""

import numpy as np
import pytest

from taskcal.correction.controller import simulate_controller
from taskcal.correction.path import PlacedMotions, Placement
from taskcal.correction.subdivision import CorrectionProblem, subdivide


@pytest.fixture
def problem(robot, calibration, make_moves, shifted):
    def build(tolerance, widest=0.0):
        motions = make_moves(
            [shifted(0, 0, 0), shifted(150, 0, 0), shifted(150, 120, 0)], vias={2: shifted(180, 60, 0)}
        )
        trajectory = simulate_controller(robot, motions)
        placed = PlacedMotions(
            tool_in_base=lambda q, move, share: calibration.tool_in_base(q),
            placements=(Placement(T_tool_grasped=np.eye(4), T_base_fixed=np.eye(4), part_in_hand=False),),
            number=np.zeros(len(motions), dtype=np.int64),
        )
        return CorrectionProblem(
            robot=robot, motions=motions, calibration=calibration, placed=placed, trajectory=trajectory, directions=None,
            wanted=trajectory.path_on(placed, motions).segments, tolerance=tolerance, widest=widest,
        )  # fmt: skip

    return build


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6])
def test_nodes_are_met_and_the_path_between_them_is_kept(problem, tolerance):
    given = problem(tolerance)
    subdivision = subdivide(given)
    nodes = subdivision.nodes
    assert nodes.reached.all()
    true = given.placed.tool_in_part(nodes.move, nodes.share, nodes.q)
    np.testing.assert_allclose(true, nodes.wanted, atol=1e-8)
    # the controller moves to these joints for the poses that are written
    np.testing.assert_allclose(given.nominal.tool_in_part(nodes.move, nodes.share, nodes.q), nodes.T, atol=1e-8)
    assert (subdivision.deviation <= tolerance).all()
    assert (np.diff(nodes.move + 0.999 * nodes.share) > 0.0).all()
    per_piece = np.array([1, 1, 2])  # an arc's pieces have a via point each
    np.testing.assert_array_equal(np.bincount(nodes.move), subdivision.pieces * per_piece)


def test_tighter_tolerance_takes_more_pieces(problem):
    """A tighter tolerance takes more pieces and a motion of all joints none."""
    wide, tight = (subdivide(problem(tolerance)).pieces for tolerance in (1e-4, 3e-7))
    assert wide[0] == tight[0] == 1
    assert (tight[1:] > wide[1:]).all()


def test_growth_widens_the_tolerance_to_its_bound(problem):
    """A program that would grow too much is divided less up to the widest tolerance."""
    fine = subdivide(problem(1e-7))
    assert fine.tolerance == 1e-7
    assert fine.pieces.sum() > 6
    wide = subdivide(problem(1e-7, widest=1.0))
    assert wide.pieces.sum() <= 4  # three motions and half of them again
    assert (wide.deviation <= wide.tolerance).all()
    some = subdivide(problem(1e-7, widest=2e-7))
    assert 1e-7 < some.tolerance <= 2e-7
    assert wide.pieces.sum() < some.pieces.sum() < fine.pieces.sum()
