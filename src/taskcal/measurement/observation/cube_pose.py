"""How a cube stands, by the planes of its faces."""

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.measurement.observation.touched_planes import FittedPlanes

LARGEST_TURN = 0.7
"""Radians by which a touched plane may be turned against the face that it is called: where two names are exchanged, the nearest
cube has a face that is turned by 1.2 at least …"""

LARGEST_LIFT = 5.0
"""… unless that moves its touches by less than so many times what all are off their own planes, root mean square …"""

SMALLEST_LIFT = 1e-3
"""… or by less than this, metres: what is touched at one spot alone has any plane."""


def pose_of_faces(
    fitted: FittedPlanes,
    faces: Int[np.ndarray, " f"],
    normals: Float[np.ndarray, "f 3"],
    stand_off: float,
    names: tuple[str, ...],
) -> Float[np.ndarray, " 6"]:
    """Middle and rotation vector of a cube; a normal is outward if the touches of the other faces are behind.

    A face says the more of how the cube is turned, the wider it was touched.

    Args:
        fitted: planes of all faces.
        faces: numbers of those of this cube.
        normals: theirs, outward, in the cube's axes.
        stand_off: of the tip's centre from the middle, where it touches a face, metres.
        names: of all faces.

    Raises:
        CampaignError: the planes are not the faces that they are called.
    """
    planes, at, (rough, width) = fitted.planes[faces], fitted.middle[faces], fitted.spread[faces, :2].T
    behind = (at.sum(axis=0) - at) / (len(faces) - 1)
    outward = planes[:, :3] * np.sign((planes[:, :3] * (at - behind)).sum(axis=1))[:, None]
    R = se3.nearest_rotation(np.einsum("f,fi,fj->ij", width**2, outward, normals))
    of_faces = normals @ R.T
    lean = np.arccos(np.clip((of_faces * outward).sum(axis=1), -1.0, 1.0))
    lift = np.sin(np.minimum(lean, 0.5 * np.pi)) * width
    lean = np.where(lift > max(LARGEST_LIFT * float(np.sqrt(np.mean(rough**2))), SMALLEST_LIFT), lean, 0.0)
    if lean.max() > LARGEST_TURN:
        raise CampaignError(
            f"the touches of face {names[faces[int(lean.argmax())]]} are turned by {np.degrees(lean.max()):.0f}° from where the "
            "other faces of the cube have it: look at the names of the faces; +x, +y and +z are a right-handed frame, seen from "
            "outside"
        )
    middle = np.linalg.lstsq(of_faces, (of_faces * at).sum(axis=1) - stand_off, rcond=1e-6)[0]
    return np.concatenate([middle, se3.log(R)])
