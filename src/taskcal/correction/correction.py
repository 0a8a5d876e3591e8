"""A Correction: a program rewritten for the robot as calibrated, and what that does to its accuracy."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from robot_programs.core.program import Diagnostic, Motion, Program
from robot_programs.core.source import Place, Source
from robot_programs.reading import written_files
from taskcal.correction.controller import ControllerTrajectory, JointMotion
from taskcal.correction.frames import SOURCES, Uncertainty
from taskcal.correction.options import Bounds
from taskcal.correction.path import PlacedMotions, RoundedPath
from taskcal.errors import FileError, shortened
from taskcal.geometry import se3
from taskcal.identification.measured_range import MeasuredRange
from taskcal.identification.uncertainty_budget import (
    REACHED,
    UNEXPLAINED,
    Evaluation,
    UncertaintyBudget,
    budget_of_parts,
)
from taskcal.io.files import Laid, write_all
from taskcal.short_repr import short_repr
from taskcal_groundwork.said import Said

# How far the true tool is from where a program wants it, at its targets and between them.


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Deviations:
    """Deviations of the true tool from the program."""

    move: Int[np.ndarray, " k"]
    """Motion of the program as it was given."""
    share: Float[np.ndarray, " k"]
    """Share of its length."""
    at_target: Bool[np.ndarray, " k"]
    """At the motion's end, which is in its target or in the middle of the corner there; elsewhere the component along the path is
    left out of the error."""
    q: Float[np.ndarray, "k joints"]
    """Joint positions of the controller, radians."""
    error: Float[np.ndarray, "k 3"]
    """True less wanted position of the TCP in the part's axes, metres."""
    turn: Float[np.ndarray, " k"]
    """Angle between true and wanted orientation, radians."""

    def of_moves(self, motions: Bool[np.ndarray, " m"]) -> "Deviations":
        """Deviations in some of the motions."""
        return self.rows(np.flatnonzero(motions[self.move]))

    def rows(self, rows: Int[np.ndarray, " r"]) -> "Deviations":
        """Some of the deviations."""
        return Deviations(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    @property
    def length(self) -> Float[np.ndarray, " k"]:
        """Lengths of the errors, metres."""
        return np.linalg.norm(self.error, axis=1)

    def farthest(self, measured: MeasuredRange, motions: int) -> Float[np.ndarray, "m joints"]:
        """Joint positions of each motion where it is farthest outside of what was measured; NaN where none are known.

        Args:
            measured: joint range of the calibration.
            motions: how many motions the program has.
        """
        out = np.full((motions, self.q.shape[1]), np.nan)
        order = np.argsort(np.abs(measured.beyond(self.q)).max(axis=1, initial=0.0), kind="stable")
        out[self.move[order]] = self.q[order]  # of several rows of a motion the last one stays
        return out


def assess(
    placed: PlacedMotions,
    wanted: RoundedPath,
    trajectory: ControllerTrajectory,
    origin: Sequence[tuple[int, float, float]] | None = None,
) -> Deviations:
    """Compare the true tool with the path that a program asks for; between targets only where a segment's start is known.

    Args:
        placed: the motions of the program as it was given, on the robot as calibrated, or as it truly is.
        wanted: the path that it asks for, tool in part.
        trajectory: where the controller moves its joints, in this program or in a rewritten one.
        origin: for each motion of the rewritten program, the one it comes from, and the shares of its length where it
            begins and ends; the program itself by default.
    """
    table = np.array([(i, 0.0, 1.0) for i in range(len(trajectory.end))] if origin is None else origin, dtype=float)
    table = table.reshape(-1, 3)
    source = table[:, 0].astype(np.int64)
    unsampled = np.isfinite(trajectory.end[:, 0])
    unsampled[trajectory.move] = False  # a sampled motion has its end among the samples
    single = np.flatnonzero(unsampled)
    move = np.concatenate([trajectory.move, single])
    share = np.concatenate([trajectory.share, np.ones(len(single))])
    q = np.concatenate([trajectory.q, trajectory.passes[single]])
    order = np.lexsort((share, move))
    move, share, q = move[order], share[order], q[order]
    first, last = table[move, 1], table[move, 2]
    original, along = source[move], first + share * (last - first)
    at_target = along >= 1.0 - 1e-12
    assessable = at_target | np.isfinite(wanted.segments.start[original, 0, 0])
    original, along, q, at_target = original[assessable], along[assessable], q[assessable], at_target[assessable]
    T = wanted.at(original, along)
    true = placed.tool_in_part(original, along, q)
    error = true[:, :3, 3] - T[:, :3, 3]
    between = np.flatnonzero(~at_target)
    tangent = wanted.direction(original[between], along[between])
    error[between] -= (error[between] * tangent).sum(axis=1, keepdims=True) * tangent
    turn = np.linalg.norm(se3.log(true[:, :3, :3] @ np.swapaxes(T[:, :3, :3], 1, 2)), axis=1)
    return Deviations(move=original, share=along, at_target=at_target, q=q, error=error, turn=turn)


# The error to be expected along a corrected program, and what it comes from.

LEFT = "uncorrected"
"""The predicted error of the corrected program, among the sources of what is to be expected of it."""

REMEDIES = {
    "geometry": "the geometry is known too badly where the program works: measure more poses there (taskcal plan --calibration)",
    "model error": "it is what the model cannot tell of a single pose: accept it, or identify with effects where that was not done "
    "(--effects auto)",
    "tool": "measure the tool against the reflectors, or touch one point with its tip, and state it in a cell file (--cell: "
    "reflectors_mm, flange or tip_deg)",
    "part": "measure the part with the tracker, or touch it with the robot, and state it in a cell file (--cell: tracker or "
    "touched_deg)",
    LEFT: "it is predicted, and not corrected: see which motions stay unchanged, and why",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class ErrorBudget:
    """Mean squares over the targets of a program, in space, metres²."""

    correction: float
    """Of the error that is predicted for the program as it was given."""
    left: float
    """Of the error that is predicted for the corrected program."""
    variances: Mapping[str, float]
    """Of what the calibration must expect beyond its prediction, by `SOURCES`."""
    variance_of_mean_square: float = 0.0
    """Of the variances' sum, as an error that is realised once; metres⁴."""
    least: float | None = None
    """Their sum without what it grows by beyond the measured range (`Uncertainty.least`); None where it does not grow."""

    @property
    def uncertainty(self) -> float:
        """Uncertainty of the prediction, rms of the 3D error, metres."""
        return float(np.sqrt(sum(self.variances.values())))

    @property
    def before(self) -> float:
        """Error to be expected of the program as it was given, rms in space, metres."""
        return float(np.sqrt(self.correction + self.uncertainty**2))

    @property
    def after(self) -> float:
        """Error to be expected of the corrected program, rms in space, metres."""
        return float(np.sqrt(self.left + self.uncertainty**2))

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the corrected program's error, rms in space, metres.

        The mean square of errors that go together is spread as a chi-square of as many degrees of freedom as give its mean and
        its variance (Satterthwaite, Biometrics Bulletin 2, 1946). Its lower end does without the growth beyond the measured
        range: that may be needed there, or not.
        """
        from scipy.special import gammaincinv  # heavy, and a wrong file is refused before

        mean = sum(self.variances.values())
        if not (mean and self.variance_of_mean_square):
            return self.after, self.after
        half = mean**2 / self.variance_of_mean_square
        least = mean if self.least is None else self.least
        ends = ((least, 0.025), (mean, 0.975))
        low, high = (float(np.sqrt(self.left + size * gammaincinv(half, p) / half)) for size, p in ends)
        return low, high

    @property
    def largest(self) -> tuple[str, float, str]:
        """The source of the largest share of the error to be expected, that share, and advice that lowers it."""
        sources = {**self.variances, LEFT: self.left}
        name = max(sources, key=lambda source: sources[source])
        return name, sources[name] / (sum(sources.values()) or 1.0), REMEDIES[name]

    @property
    def uncertain(self) -> bool:
        """Whether the uncertainty is larger than the correction, so that nobody can tell if it makes the program better."""
        return bool(self.uncertainty > np.sqrt(self.correction))

    @property
    def shares(self) -> dict[str, float]:
        """Share of the variance by source."""
        total = sum(self.variances.values())
        return {name: value / total if total else 0.0 for name, value in self.variances.items()}

    @property
    def remedy(self) -> str:
        """Advice that lowers the largest share of the uncertainty."""
        return REMEDIES[max(self.variances, key=lambda name: self.variances[name])]

    def of_targets(self, model_error: Evaluation) -> UncertaintyBudget:
        """Uncertainty budget of a corrected target, one line for each source (JCGM 100:2008, GUM).

        Args:
            model_error: whether the model error was estimated (A) or given (B).
        """
        return budget_of_parts(
            [
                ("parameters and tracker frame: posterior covariance", "A", self.variances["geometry"]),
                (f"{UNEXPLAINED}; {REACHED}", model_error, self.variances["model error"]),
                ("where the tool is on the flange", "B", self.variances["tool"]),
                ("where the part is", "B", self.variances["part"]),
                (
                    "remaining predicted error: rounding of the numbers, unchanged motions",
                    "B",
                    self.left,
                ),
            ]
        )

    def summary(self) -> dict[str, object]:
        """In millimetres."""
        return {
            "before_mm": self.before * 1e3,
            "after_mm": self.after * 1e3,
            "interval_mm": [bound * 1e3 for bound in self.interval],
            "correction_mm": float(np.sqrt(self.correction)) * 1e3,
            "uncertainty_mm": self.uncertainty * 1e3,
            "shares": self.shares,
        }


def budget_of(before: Float[np.ndarray, " b"], after: Float[np.ndarray, " a"], uncertainty: Uncertainty) -> ErrorBudget:
    """The budget over a program.

    Args:
        before: lengths of the predicted errors at its targets, metres.
        after: the same, corrected.
        uncertainty: of the prediction at every target.
    """
    return ErrorBudget(
        correction=float(np.mean(before**2)) if len(before) else 0.0,
        left=float(np.mean(after**2)) if len(after) else 0.0,
        variances=dict(zip(SOURCES, uncertainty.mean.tolist(), strict=True)),
        variance_of_mean_square=uncertainty.variance_of_mean_square,
        least=uncertainty.least,
    )


TOLERANCE = 2e-5
"""Of the true tool's distance from its path between corrected targets, metres."""

SHARE_OF_UNCERTAINTY = 0.2
"""A distance from the path that is this share of the uncertainty adds a fiftieth to it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Helper:
    """A module that corrects at run time."""

    path: Path
    """Its file; the program's own where it is a part of that."""
    operations: int
    """Sums, products and functions of one evaluation of the calibrated robot."""
    motions: tuple[Place, ...]
    """That it corrects."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Correction:
    """A corrected program and its report."""

    program: Program
    """As it was given."""
    sources: tuple[Source, ...]
    """The files of the corrected program, named as they were read."""
    motions: tuple[Motion, ...]
    """Motions of the corrected program, as read again from its files."""
    bounds: Bounds
    tolerance: float
    """To which lines and arcs were divided, metres."""
    wanted: RoundedPath
    """The path that the true tool is to take, tool in part."""
    before: Deviations
    """Predicted errors of the program as it was given."""
    after: Deviations
    """Predicted errors of the corrected program, as read again from its files."""
    budget: ErrorBudget
    """The error to be expected before and after, and where it comes from."""
    corrected: Int[np.ndarray, " c"]
    """Numbers of the motions that were corrected."""
    pieces: Int[np.ndarray, " m"]
    """Into how many motions each became."""
    origin: tuple[tuple[int, float, float], ...]
    """For each corrected motion, the one it comes from and the shares of that one's length where it begins and ends."""
    shift: Float[np.ndarray, " m"]
    """How far each target was moved, or an arc's point on the way where that went farther, metres."""
    turn: Float[np.ndarray, " m"]
    """How far it was turned, radians."""
    uncertainty: Float[np.ndarray, " m"]
    """Root mean square of the error in space that the calibration must expect at each target, metres; NaN where rejected."""
    joint_change: Float[np.ndarray, " m"]
    """Largest change of a revolute joint at each target, radians."""
    measured_range: MeasuredRange
    """Where the calibration was measured."""
    farthest: Float[np.ndarray, "m joints"]
    """Joint positions of each motion of the corrected program where it is farthest outside of that range, radians; NaN where not
    known."""
    rejected: Mapping[int, str]
    """Motions left as they were, and why."""
    diagnostics: tuple[Diagnostic, ...]
    """What else the user should know, by file and line."""
    statements: tuple[str, ...]
    """Relative to which frames, with which tools, and on which controller the program is accurate."""
    motion: JointMotion
    """How the corrected program moves the joints."""
    unknown: str = ""
    """Why the calibration is not to be used at the targets, where that was accepted; empty where it knows them."""
    doubts: tuple[str, ...] = ()
    """What puts the calibration in doubt (`Calibration.doubts`): then the errors before and after may not be those of this
    program."""
    asked: str = ""
    """What to state of the controller's kinematics, where they are the arm's own and were not stated; empty otherwise."""
    helper: Helper | None = None
    """Module among the sources that corrects at run time what the text does not tell."""
    added_lines: int = 0
    """By how many lines the program's files grow; none of a new program."""

    def __repr__(self) -> str:
        rejected = f", {len(self.rejected)} rejected" if self.rejected else ""
        return (
            f"Correction({shortened(', '.join(str(source.path) for source in self.sources), 120)}: {len(self.corrected)} of "
            f"{len(self.program.motions)} motions corrected{rejected}, targets moved by up to "
            f"{np.nanmax(self.shift, initial=0.0) * 1e3:.3f} mm)"
        )

    @property
    def uncertain(self) -> bool:
        """Whether anything was corrected by less than the calibration's own uncertainty."""
        return bool(len(self.corrected)) and self.budget.uncertain

    @property
    def why_unwritten(self) -> str:
        """Why nothing is written: no motion was corrected, here or at run time, and some were refused; empty where one was."""
        refused = [f"{self.program.motions[i].place}: {why}" for i, why in sorted(self.rejected.items())]
        refused += [str(diagnostic) for diagnostic in self.diagnostics if diagnostic.rejected]
        if len(self.corrected) or self.helper is not None or not refused:
            return ""
        said = Said(
            "no motion was corrected, so that the program would be the one that was read; {why}", why=refused[0]
        )
        return Said("{said} (and {count} more)", said=said, count=len(refused) - 1) if len(refused) > 1 else said

    def write(self, out: str | Path) -> tuple[Path, ...]:
        """Write the corrected files, all or none; of a backup all of it, to a place that does not exist yet.

        Raises:
            FileError: it would overwrite what was read, or cannot be written; or every motion was refused.
        """
        if self.why_unwritten:
            raise FileError(out, f"is not written: {self.why_unwritten}")
        contents, lay = self.parts(out)
        write_all(contents, lay)
        return (Path(out),) if lay is not None else tuple(contents)

    def parts(self, out: str | Path) -> tuple[dict[Path, bytes], Callable[[], Laid] | None]:
        """What `write` writes: contents of files, or what lays a backup beside its place.

        Raises:
            FileError: it would overwrite what was read.
        """
        if self.helper is None or self.helper.path == self.sources[0].path:
            return written_files(self.program, self.sources, out)
        out, own = Path(out), [source for source in self.sources if source.path != self.helper.path]
        contents, lay = written_files(self.program, own, out)
        beside = (out if out.is_dir() else out.parent) / self.helper.path.name
        if beside in contents:
            raise FileError(beside, "would be both the program and its helper; name another file")
        (added,) = (source for source in self.sources if source not in own)
        return contents | {beside: added.encode()}, lay

    def summary(self) -> dict[str, Any]:
        """The report in numbers, in millimetres and degrees."""
        return {
            "moves": len(self.program.motions),
            "corrected": len(self.corrected),
            "refused": len(self.rejected),
            "unresolved": len(self.program.diagnostics),
            "written_moves": len(self.motions),
            "added_lines": self.added_lines,
            "at_run_time": 0 if self.helper is None else len(self.helper.motions),
            "tolerance_mm": self.tolerance * 1e3,
            "expected": self.budget.summary(),
            "before": _errors(self.before),
            "after": _errors(self.after),
            "uncertainty_rms_mm": _largest(self.uncertainty) * 1e3,
            "largest_shift_mm": _largest(self.shift) * 1e3,
            "largest_turn_deg": float(np.degrees(_largest(self.turn))),
            "largest_joint_change_deg": float(np.degrees(_largest(self.joint_change))),
            "outside_moves": int(self.measured_range.outside(self.farthest).sum()),
            "measured_range": self.measured_range.summary(),
            "relative_to": list(self.statements),
            "doubts": list(self.doubts),
            **self.motion.summary(),
        }

    def targets(self, count: int | None = None) -> list[dict[str, Any]]:
        """Correction of the motions' targets, in the order of the program, in millimetres and degrees.

        Args:
            count: so many at most, those with the largest errors before; all by default.
        """
        errors: dict[str, dict[int, float]] = {}
        for label, deviations in (("before_mm", self.before), ("after_mm", self.after)):
            rows = np.flatnonzero(deviations.at_target)
            lengths = (deviations.length[rows] * 1e3).tolist()
            errors[label] = dict(zip(deviations.move[rows].tolist(), lengths, strict=True))
        motions = self.program.motions
        chosen = range(len(motions))
        if count is not None and len(motions) > count:
            chosen = sorted(sorted(chosen, key=lambda i: -errors["before_mm"].get(i, 0.0))[:count])
        outside = self.measured_range.farthest(self.farthest[np.array(chosen, dtype=np.int64)])
        return [
            {
                "file": str(move.place.path),
                "line": move.place.line,
                "target": move.end.name,
                "kind": move.kind,
                "tool": move.tool.name,
                "frame": move.part.name,
                "before_mm": errors["before_mm"].get(i),
                "after_mm": errors["after_mm"].get(i),
                "uncertainty_rms_mm": float(self.uncertainty[i]) * 1e3,
                "shift_mm": float(self.shift[i]) * 1e3,
                "turn_deg": float(np.degrees(self.turn[i])),
                "joint_change_deg": float(np.degrees(self.joint_change[i])),
                "written_as": int(self.pieces[i]),
                **beyond,
                "refused": self.rejected.get(i, ""),
            }
            for i, beyond in zip(chosen, outside, strict=True)
            for move in (motions[i],)
        ]

    def told(self, most: int | None = None, *, targets: int | None = None) -> dict[str, Any]:
        """The summary, with its motions in lists: targets, those that were refused, and remarks, each with its place.

        Args:
            most: of each list; all by default.
            targets: of those with the largest errors before; `most` by default.
        """
        refused, motions = sorted(self.rejected.items())[:most], self.program.motions
        return {
            **self.summary(),
            "targets": self.targets(most if targets is None else targets),
            "refused": [
                {"file": motions[i].place.path, "line": motions[i].place.line, "reason": reason}
                for i, reason in refused
            ],
            "remarks": [
                {"file": one.place.path, "line": one.place.line, "text": one.text} for one in self.diagnostics[:most]
            ],
        }


def _largest(values: Float[np.ndarray, " m"]) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if len(finite) else 0.0


def _errors(deviations: Deviations) -> dict[str, Any]:
    """Statistics of errors at targets and between them, millimetres; None where there is nothing of the kind."""
    return {
        where: None if not rows.any() else _statistics(deviations.error[rows], deviations.turn[rows])
        for where, rows in (("targets", deviations.at_target), ("between", ~deviations.at_target))
    }


def _statistics(error: Float[np.ndarray, "k 3"], turn: Float[np.ndarray, " k"]) -> dict[str, float]:
    length = np.linalg.norm(error, axis=1) * 1e3
    x, y, z = (float(value) for value in np.abs(error).max(axis=0) * 1e3)
    return {
        "max_mm": float(length.max()),
        "rms_mm": float(np.sqrt((length**2).mean())),
        "mean_mm": float(length.mean()),
        "max_x_mm": x,
        "max_y_mm": y,
        "max_z_mm": z,
        "max_turn_deg": float(np.degrees(turn.max())),
        "count": len(length),
    }
