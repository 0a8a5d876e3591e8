"""What a calibration was worth, in one sentence."""

NOMINAL = "nominal (registered)"
"""The robot as its maker describes it, with tracker frame and targets fitted to the measurements."""


def verdict(robot: str, before: float, after: float, held_out: int | None, *, in_space: bool = True) -> str:
    """The sentence: it is about predictions, since the robot goes where it went until its programs are corrected.

    Args:
        robot: its name.
        before: mean error of the nominal robot, registered, millimetres.
        after: of the calibrated one, on the same points.
        held_out: how many points that were not fitted these are means of; None for fitted ones.
        in_space: whether the errors are distances in space, not those of single numbers such as lengths.
    """
    where = f"{held_out} held-out points" if held_out is not None else "fitted rows, optimistic: none were held out"
    change = "falls" if after < before else "does not fall"
    ratio = f"ratio {before / after:.1f}, " if after > 0.0 else ""
    what = "mean 3D prediction error" if in_space else "mean prediction error"
    return (
        f"{robot}: the {what} {change} from {before:.3f} mm, {NOMINAL}, to {after:.3f} mm, calibrated ({ratio}{where})."
    )
