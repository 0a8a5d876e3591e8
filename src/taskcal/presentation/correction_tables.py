"""What a correction does to a program, as tables."""

from pathlib import Path

import numpy as np

from taskcal.correction.correction import Correction
from taskcal.presentation.content import Table

_COLUMNS = ("max_mm", "rms_mm", "mean_mm", "max_x_mm", "max_y_mm", "max_z_mm", "max_turn_deg")


def state_expected(correction: Correction) -> list[tuple[str, str]]:
    """The error to be expected before and after, with the uncertainty and where it comes from; label and text."""
    if not len(correction.before.error):
        return [("to be expected", "not known: the robot reaches no target of the program; the reasons stand below")]
    budget = correction.budget
    shares = ", ".join(f"{name} {share:.0%}" for name, share in budget.shares.items())
    return [
        (
            "to be expected",
            f"{budget.before * 1e3:.3f} mm before, {budget.after * 1e3:.3f} mm after (rms in space at the targets)",
        ),
        ("corrected", f"{np.sqrt(budget.correction) * 1e3:.3f} mm, known to ± {budget.uncertainty * 1e3:.3f} mm"),
        ("± comes from", shares),
    ]


def state_uncertain(correction: Correction) -> str:
    """Why a correction is not worth writing, and what to measure."""
    budget = correction.budget
    share = max(budget.shares.items(), key=lambda item: item[1])
    return (
        f"the correction of {np.sqrt(budget.correction) * 1e3:.3f} mm is smaller than its uncertainty of "
        f"{budget.uncertainty * 1e3:.3f} mm (rms), of which {share[1]:.0%} is {share[0]}: {budget.remedy}"
    )


def tabulate_errors(correction: Correction) -> Table:
    """Predicted errors before and after, at targets and between them."""
    summary = correction.summary()
    rows: list[tuple[str, ...]] = []
    for where, label in (("targets", "at targets"), ("between", "between targets")):
        for when in ("before", "after"):
            deviations = summary[when][where]
            if deviations is not None:
                rows.append(
                    (f"{label}, {when}", str(deviations["count"]), *(f"{deviations[key]:.4f}" for key in _COLUMNS))
                )
    return Table.of_rows(
        "Predicted error of the true tool, without its uncertainty",
        ("", "points", "max mm", "rms mm", "mean mm", "max x", "max y", "max z", "max turn °"),
        rows,
        note="In the part's axes. Between targets, what lies along the way is left out. At a target that a zone rounds, the middle "
        "of the corner counts.",
    )


def tabulate_targets(correction: Correction, count: int | None = None) -> Table:
    """Targets with the largest errors before, or all of them in the order of the program."""
    targets = correction.targets()
    if count is not None:
        targets = sorted(targets, key=lambda t: -(t["before_mm"] or 0.0))[:count]
    rows = [
        (
            f"{Path(t['file']).name}:{t['line']}",
            t["target"],
            t["kind"],
            t["tool"],
            t["frame"],
            _number(t["before_mm"]),
            _number(t["after_mm"]),
            _number(t["uncertainty_rms_mm"]),
            _number(t["shift_mm"]),
            _number(t["joint_change_deg"]),
            str(t["written_as"]),
        )
        for t in targets
    ]
    title = "Targets" if count is None or len(rows) < count else f"The {len(rows)} targets with the largest errors"
    return Table.of_rows(
        title,
        (
            "line",
            "target",
            "motion",
            "tool",
            "frame",
            "before mm",
            "after mm",
            "± rms mm",
            "moved mm",
            "joints °",
            "as",
        ),
        rows,
        text_columns=(0, 1, 2, 3, 4),
        note="± rms: what the calibration must expect at the target. As: motions that one became.",
        folded=count is None,
    )


def tabulate_correction(correction: Correction) -> list[tuple[str, str]]:
    """What else there is to say, label and text."""
    motion, robot = correction.motion, correction.motion.robot
    summary = correction.summary()
    facts = [("relative to", statement) for statement in correction.statements]
    facts.append(
        (
            "motions",
            f"{summary['moves']}, of which {summary['corrected']} corrected and written as "
            f"{int(correction.pieces[correction.corrected].sum())}, {summary['refused']} refused, "
            f"{summary['moves'] - summary['corrected'] - summary['refused']} as they were; "
            f"{summary['unresolved']} remarks on what was not read",
        )
    )
    more = int(correction.pieces[correction.corrected].sum()) - summary["corrected"]
    facts.append(
        (
            "lines and arcs",
            f"divided until the true tool keeps to them within {summary['tolerance_mm']:.3f} mm: {more} motions more",
        )
    )
    facts.append(
        (
            "largest change",
            f"{summary['largest_shift_mm']:.3f} mm, {summary['largest_turn_deg']:.3f}°, "
            f"a joint by {summary['largest_joint_change_deg']:.3f}°",
        )
    )
    for label, key, unit in (("joint speed", "joint_speed", "/s"), ("joint acceleration", "joint_acceleration", "/s²")):
        deviations = summary[key]
        if not deviations:
            facts.append((label, "not known: no speed is programmed along lines and arcs"))
            continue
        scale = dict(zip(robot.joint_names, ("mm" if slides else "°" for slides in robot.prismatic), strict=True))
        words = [
            f"{name} {entry['largest']:.1f}{scale[name]}{unit}"
            + (f" of {entry['limit']:.0f}" if entry["limit"] is not None else "")
            for name, entry in deviations.items()
        ]
        facts.append((label, ", ".join(words)))
    if np.isfinite(motion.conditioning):
        facts.append(
            ("nearest to singular", f"ratio {motion.conditioning:.3f} of the Jacobian's singular values; 0 is singular")
        )
    return facts


def _number(value: float | None) -> str:
    return "" if value is None or not np.isfinite(value) else f"{value:.4f}"
