"""Relations that are found at some poses hold at every other, for robots of every structure and with large defects."""

import numpy as np
import pytest

from taskcal.analysis.identifiability import identifiability
from tests.laws.cells import STRUCTURES, cell, unseen


@pytest.mark.parametrize("components", ["position", "pose"])
@pytest.mark.parametrize("structure", STRUCTURES)
def test_relations_hold_at_poses_at_which_they_were_not_found(structure, components):
    some = cell(structure, rows=90, tolerance=5.0)
    model, x = some.model, some.truth.x
    found = identifiability(model, some.campaign.q, x, components=components, frames=True)
    assert found.agrees
    assert found.dependent
    elsewhere = identifiability(model, unseen(some, 60), x, components=components, frames=True)
    # the same columns but for a rotation, so that they have the same relations
    J, kept = elsewhere.matrix, [found.names.index(name) for name in found.kept]
    # coefficients under 10⁻⁸ of a relation's largest are left out of it
    off = np.linalg.norm(J[:, kept] @ found.relations() - J, axis=0)
    assert (off < 1e-7 * np.linalg.norm(J, axis=0).max()).all()
    assert found.rank == elsewhere.rank
