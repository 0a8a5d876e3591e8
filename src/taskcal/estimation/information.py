"""What an information matrix, or a stack of sensitivities, says of its parameters."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, kw_only=True)
class Observability:
    """Observability indices of a set of poses (Sun and Hollerbach 2008); larger is better in each."""

    O1: float
    """Geometric mean of the singular values over √n (Borm and Menq 1991)."""
    O2: float
    """Smallest over largest singular value (Driels and Pathre 1990)."""
    O3: float
    """Smallest singular value (Nahvi et al. 1994)."""
    O4: float
    """O3·O2, the noise amplification index (Nahvi and Hollerbach 1996)."""
    O5: float
    """Harmonic mean of the singular values (Sun and Hollerbach 2008)."""


def observability(singular_values: Float[np.ndarray, " p"], poses: int) -> Observability:
    """Observability indices from the singular values of the stacked sensitivities of some poses."""
    s = np.asarray(singular_values, dtype=float)
    if not len(s):
        return Observability(O1=0.0, O2=0.0, O3=0.0, O4=0.0, O5=0.0)
    low, high = float(s.min()), float(s.max())
    if low == 0.0:
        return Observability(O1=0.0, O2=0.0, O3=0.0, O4=0.0, O5=0.0)
    return Observability(
        O1=float(np.exp(np.log(s).mean()) / np.sqrt(poses)),
        O2=low / high,
        O3=low,
        O4=low * low / high,
        O5=float(len(s) / np.sum(1.0 / s)),
    )
