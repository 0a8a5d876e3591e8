"""What a calibration was worth, in one sentence."""


def verdict(robot: str, before: float, after: float, held_out: int | None, *, in_space: bool = True) -> str:
    """The sentence.

    Args:
        robot: its name.
        before: mean error of the nominal robot, millimetres.
        after: of the calibrated one, on the same points.
        held_out: how many points that were not fitted these are means of; None for fitted ones.
        in_space: whether the errors are distances in space, not those of single numbers such as lengths.
    """
    where = (
        f"on {held_out} points that were not fitted"
        if held_out is not None
        else "on the fitted rows themselves, which is too good: none were held out"
    )
    change = f"{before / after:.1f} times as accurate as before" if after < before else "no better than before"
    what = "mean error in space" if in_space else "mean error"
    return f"{robot} is {change}: {before:.3f} mm {what} nominally, {after:.3f} mm calibrated, {where}."
