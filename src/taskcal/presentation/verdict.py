"""What a calibration was worth, in one sentence."""


def verdict(robot: str, before: float, after: float, held_out: int | None) -> str:
    """The sentence.

    Args:
        robot: its name.
        before: mean error in space of the nominal robot, millimetres.
        after: of the calibrated one, on the same points.
        held_out: how many points that were not fitted these are means of; None for fitted ones.
    """
    where = (
        f"on {held_out} points that were not fitted"
        if held_out is not None
        else "on the fitted rows themselves, which is too good: none were held out"
    )
    change = f"{before / after:.1f} times as accurate as before" if after < before else "no better than before"
    return f"{robot} is {change}: {before:.3f} mm mean error in space nominally, {after:.3f} mm calibrated, {where}."
