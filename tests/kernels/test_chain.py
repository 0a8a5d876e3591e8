"""Chains as arrays: what is fixed is gathered, what moves keeps its order."""

import numpy as np
from hypothesis import given

from taskcal.kernels.chain import Chain, Fixed
from tests.laws.chains import ChainCase, chains, rigid
from tests.laws.robots import generators


@given(chains(), generators)
def test_neighbouring_fixed_parts_become_one_and_identities_none(case: ChainCase, rng: np.random.Generator) -> None:
    split = []
    for step in case.steps:
        split.append(Fixed(np.eye(4)))
        if isinstance(step, Fixed):
            half = rigid(rng)
            split += [Fixed(half), Fixed(np.linalg.inv(half) @ step.transform)]
        else:
            split.append(step)
    chain = Chain.of(split)
    np.testing.assert_array_equal(chain.kind, case.chain.kind)
    np.testing.assert_array_equal(chain.index, case.chain.index)
    np.testing.assert_allclose(chain.fixed, case.chain.fixed, atol=1e-12)
    assert (chain.joints, chain.frames) == (case.s.shape[1], len(case.e))
