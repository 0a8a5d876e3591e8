"""The calibration file: its schema, and the calibration it describes."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field, ValidationError

from taskcal.errors import FileError, TaskcalError, shown
from taskcal.estimation.scaled import factor_positive
from taskcal.geometry.described_arrays import array_of, of_shape, rigid
from taskcal.identification.calibration import Calibration
from taskcal.identification.calibration_envelope import read_envelope
from taskcal.identification.considered import spread_out
from taskcal.identification.field import ResidualField
from taskcal.identification.held_out import HeldOut
from taskcal.identification.observation_layout import ObservationLayout
from taskcal.identification.observation_section import ObservationSection
from taskcal.identification.outlier import LeftOut, Outlier
from taskcal.identification.packed_covariance import factor_of, unpack_covariance, unpack_factor
from taskcal.identification.problem import FrameLayout
from taskcal.identification.provenance import Provenance
from taskcal.measurement.observation import Observation
from taskcal.measurement.registration_file import RegistrationSection
from taskcal.robot.effects import Effect, effect_from
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.file import robot_from
from taskcal.robot.parameter import current_parameter
from taskcal.toml_file import Finite, NotNegative, Section, explain

SYMMETRY_TOLERANCE = 1e-6
"""Of a covariance, relative to the two standard deviations; rounding of the fit leaves 10⁻⁹ at the worst."""

FACTOR_FROM = 7
"""Format version from which on a file holds a factor of the covariance."""

Count = Annotated[int, Field(strict=True, ge=0, le=10**9)]
Real = Annotated[float, Field(strict=True, ge=-1e300, le=1e300, allow_inf_nan=False)]
AboveZero = Annotated[float, Field(strict=True, gt=0, le=1e6, allow_inf_nan=False)]
Ratio = Annotated[float, Field(strict=True, ge=0, le=1e300, allow_inf_nan=False)]
Flag = Annotated[bool, Field(strict=True)]
Texts = list[str]
Vector = list[Finite]
Matrix = list[list[Finite]]


class FieldSection(Section):
    """A residual field."""

    q: Matrix
    weights: Matrix
    lengths: list[AboveZero]
    deviation: list[AboveZero]
    noise: list[NotNegative]


class OutlierSection(Section):
    """A point that the fit cannot believe."""

    row: Count | None
    line: Count | None = None
    id: str
    target: str
    studentised: Ratio
    residual: NotNegative

    def outlier(self, version: int) -> Outlier:
        """The outlier; in a file of an older version it has its id, but no row of the campaign."""
        content = self.model_dump()
        if version < 3:
            content["row"] = None
        return Outlier(**content)


class LeftOutSection(Section):
    """A row that was not fitted."""

    row: Count
    line: Count | None = None
    id: str
    distance: NotNegative
    studentised: Ratio


class HeldOutSection(Section):
    """Rows that were not fitted, and what was predicted of them."""

    by: Literal["neighbours", "blocks", "rows", "chosen"]
    folds: Count
    rows: list[Count] = Field(min_length=1)
    part: list[Count]
    residuals: list[list[list[Finite | None]]]
    nominal: list[list[list[Finite | None]]]

    def held_out(self, targets: int, width: int, kinds: tuple[type[Observation], ...]) -> HeldOut:
        """What it describes, of targets that were observed so.

        Raises:
            TaskcalError: the parts do not belong together.
        """
        n = len(self.rows)
        shape = n, targets, width
        of_shape("held_out, part", np.array(self.part), (n,))
        if max(self.part) >= n:
            raise TaskcalError(f"'held_out, part' counts {max(self.part) + 1} parts of {n} rows")
        residuals = array_of("held_out, residuals", self.residuals, shape)
        if not np.isfinite(residuals[..., 0]).any():
            raise TaskcalError("'held_out, residuals' holds not a single measured point")
        return HeldOut(
            by=self.by,
            folds=self.folds,
            rows=np.array(self.rows),
            part=np.array(self.part),
            residuals=residuals,
            nominal=array_of("held_out, nominal", self.nominal, shape),
            kinds=kinds,
        )


class ProvenanceSection(Section):
    """Where a calibration comes from."""

    robot: str
    robot_digest: str
    campaign: str
    campaign_digest: str
    rows: Count
    version: str
    created: str
    options: dict[str, Any]
    notes: tuple[str, ...] = ()


class CalibrationFile(Section):
    """A calibration file."""

    format: str
    format_version: int
    provenance: ProvenanceSection
    robot: dict[str, Any]
    lengths_only: Flag
    units: Literal["metres and radians"]
    effects: list[dict[str, Any]]
    kept: Texts
    targets: Texts = Field(min_length=1)
    pose: Flag
    observations: list[ObservationSection] = Field(default=[])
    fixed_frames: Flag
    turned: Flag = Field(default=False)
    registration: RegistrationSection
    names: Texts
    estimate: Vector
    covariance: Matrix | None = None
    covariance_factor: list[Vector] | None = None
    T_tracker_base: Matrix
    T_tool_target: list[Matrix]
    model_error: list[NotNegative]
    joint_error: list[NotNegative] = Field(default=[])
    prior_scale: AboveZero | None
    group_deviations: list[AboveZero] | None = Field(default=None)
    log_evidence: Real | None
    field: FieldSection | None
    ids: Texts
    q: Matrix | None = None
    residuals: list[list[list[Finite | None]]]
    studentised: list[list[Ratio | None]]
    outliers: list[OutlierSection]
    left_out: list[LeftOutSection] = Field(default=[])
    held_out: HeldOutSection | None = None
    iterations: Count
    rounds: Count
    reason: str
    remarks: Texts

    def calibration(self, effects: Sequence[Effect]) -> Calibration:
        """The calibration it describes, with its effects.

        Raises:
            TaskcalError: the robot or a parameter is not one, or the parts do not belong together.
        """
        try:
            robot = robot_from(self.robot)
        except TaskcalError as error:
            raise TaskcalError(f"its robot: {error}") from error
        if robot.digest != self.provenance.robot_digest:
            raise TaskcalError(
                f"its robot was changed: its digest is {robot.digest}, that of the robot that was fitted "
                f"'{shown(self.provenance.robot_digest)}'"
            )
        model = ErrorModel(robot, lengths_only=self.lengths_only, effects=effects)
        layout = self._layout(model)
        estimated = model.indices(map(current_parameter, self.kept))
        written = layout if self.format_version > 1 else replace(layout, kept=estimated)
        size, rows, width = len(written.names), len(self.ids), layout.block_size
        self._same_names(written.names)
        of_shape("model_error", np.array(self.model_error), (width // 3,))
        if self.joint_error:
            of_shape("joint_error", np.array(self.joint_error), (len(robot.joints),))
        if self.provenance.rows < rows:
            raise TaskcalError(f"'ids' names {rows} rows, 'provenance' {self.provenance.rows}")
        z = array_of("estimate", self.estimate, (size,))
        return Calibration(
            model=model,
            layout=layout,
            estimated=estimated,
            z=spread_out(z, written, layout),
            z_spread=spread_out(self._spread(written.names), written, layout),
            T_tracker_base=rigid("T_tracker_base", array_of("T_tracker_base", self.T_tracker_base, (4, 4))),
            T_tool_target=rigid(
                "T_tool_target", array_of("T_tool_target", self.T_tool_target, (len(self.targets), 4, 4))
            ),
            residuals=array_of("residuals", self.residuals, (rows, len(self.targets), width)),
            studentised=array_of("studentised", self.studentised, (rows, len(self.targets))),
            outliers=tuple(section.outlier(self.format_version) for section in self.outliers),
            left_out=tuple(LeftOut(**section.model_dump()) for section in self.left_out),
            ids=tuple(self.ids),
            q=None if self.q is None else array_of("q", self.q, (rows, len(robot.joints))),
            held_out=None
            if self.held_out is None
            else self.held_out.held_out(len(self.targets), width, layout.observed),
            model_error=tuple(self.model_error),
            joint_error=tuple(self.joint_error),
            prior_scale=self.prior_scale,
            group_deviations=self._group_deviations(len(model)),
            log_evidence=self.log_evidence,
            field=self._field(len(robot.joints), width),
            iterations=self.iterations,
            rounds=self.rounds,
            reason=self.reason,
            remarks=tuple(self.remarks),
            provenance=Provenance(**self.provenance.model_dump()),
        )

    def _layout(self, model: ErrorModel) -> FrameLayout:
        registration = self.registration.registration(len(self.targets))
        layout = FrameLayout(
            model=model,
            kept=np.arange(len(model)),
            registration=registration,
            targets=tuple(self.targets),
            pose=self.pose,
            fixed_frames=self.fixed_frames,
            turned=self.turned,
        )
        if not self.observations:
            return layout
        if len(self.observations) != len(self.targets):
            raise TaskcalError(f"it has {len(self.observations)} observations for {len(self.targets)} targets")
        shared = {f.name: getattr(layout, f.name) for f in fields(FrameLayout)}
        unknowns = tuple(np.array(section.unknowns, dtype=float) for section in self.observations)
        shared["registration"] = replace(registration, unknowns=unknowns)
        return ObservationLayout(**shared, kinds=tuple(section.observation() for section in self.observations))

    def _same_names(self, expected: tuple[str, ...]) -> None:
        """Estimate and covariance stand in the order of the names, so that others would give other parameters."""
        if len(self.names) != len(expected):
            raise TaskcalError(
                f"'names' has {len(self.names)} entries, the parameters kept and frames are {len(expected)}"
            )
        for number, (name, wanted) in enumerate(zip(self.names, expected, strict=True), start=1):
            if wanted not in (name, current_parameter(name)):
                raise TaskcalError(f"'names' {number} is '{shown(name)}', where '{wanted}' belongs")

    def _spread(self, names: tuple[str, ...]) -> Float[np.ndarray, "z z"]:
        """Factor of the covariance; in a file of an older version of the covariance that it holds."""
        size = len(names)
        if self.format_version >= FACTOR_FROM:
            if self.covariance_factor is None:
                raise TaskcalError("'covariance_factor' is missing")
            return factor_of(self.covariance_factor, size)
        if self.covariance is None:
            raise TaskcalError("'covariance' is missing")
        C = _covariance(array_of("covariance", self.covariance, (size, size)), names)
        return factor_positive(0.5 * (C + C.T), SYMMETRY_TOLERANCE * size)

    def _group_deviations(self, parameters: int) -> Float[np.ndarray, " p"] | None:
        if self.group_deviations is None:
            return None
        return array_of("group_deviations", self.group_deviations, (parameters,))

    def _field(self, joints: int, width: int) -> ResidualField | None:
        if self.field is None:
            return None
        rows = len(self.field.q)
        shapes = {
            "q": (rows, joints),
            "weights": (rows, width),
            "lengths": (joints,),
            "deviation": (width,),
            "noise": (width,),
        }
        return ResidualField.from_json({
            name: array_of(f"field, {name}", getattr(self.field, name), shape) for name, shape in shapes.items()
        })  # fmt: skip


def _covariance(C: Float[np.ndarray, "z z"], names: tuple[str, ...]) -> Float[np.ndarray, "z z"]:
    """A covariance, where it is one: symmetric and nowhere negative."""
    if not len(C):
        return C
    variance = np.diag(C)
    if (variance < 0.0).any():
        i = int(variance.argmin())
        raise TaskcalError(f"'covariance' is none: the variance of '{names[i]}' is {variance[i]:g}")
    deviation = np.sqrt(variance)
    # an entry held exactly has no variance, and then no covariance
    scale = np.where(deviation > 0.0, deviation, 1.0)
    correlation = C / scale / scale[:, None]
    i, j = np.unravel_index(int(np.abs(correlation - correlation.T).argmax()), C.shape)
    if abs(correlation[i, j] - correlation[j, i]) > SYMMETRY_TOLERANCE:
        raise TaskcalError(
            f"'covariance' is none: of '{names[i]}' and '{names[j]}' it is {C[i, j]:g}, the other way round {C[j, i]:g}"
        )
    lowest = float(np.linalg.eigvalsh((correlation + correlation.T) / 2.0).min(initial=0.0))
    if lowest < -SYMMETRY_TOLERANCE * len(C):
        raise TaskcalError(
            f"'covariance' is none: a combination of the parameters has the variance {lowest:.2g} of theirs"
        )
    return C


def load_calibration(path: str | Path) -> Calibration:
    """Read a calibration saved by `Calibration.save`.

    Raises:
        FileError: the file is missing, truncated, of another format or version, or inconsistent in itself; the message
            names the key and its value.
    """
    path = Path(path)
    data = read_envelope(path)
    try:
        return calibration_from(data)
    except TaskcalError as error:
        raise FileError(path, str(error)) from error


def calibration_from(data: dict[str, Any], kinds: Sequence[type[Effect]] | None = None) -> Calibration:
    """The calibration that the content of a file describes.

    Args:
        data: the content.
        kinds: of its effects; by default those that are registered under their names.

    Raises:
        TaskcalError: it is inconsistent in itself; the message names the key and its value.
    """
    try:
        if isinstance(packed := data.get("covariance_factor"), dict):
            data = {**data, "covariance_factor": unpack_factor(packed)}
        if isinstance(packed := data.get("covariance"), dict):
            data = {**data, "covariance": unpack_covariance(packed).tolist()}
    except TaskcalError as error:
        raise TaskcalError(f"{error}; it may have been edited: identify again") from error
    try:
        content = CalibrationFile.model_validate(data)
    except ValidationError as error:
        raise TaskcalError(f"{explain(error, CalibrationFile)}; it may have been edited: identify again") from error
    effects = [
        _effect(number, effect, None if kinds is None else kinds[number - 1])
        for number, effect in enumerate(content.effects, start=1)
    ]
    try:
        return content.calibration(effects)
    except TaskcalError as error:
        raise TaskcalError(f"is inconsistent: {error}; it may have been edited: identify again") from error


def expect_readable(text: str, calibration: Calibration) -> None:
    """Read the text of a calibration's file back before it is written.

    Raises:
        TaskcalError: it would be refused, or be another calibration.
    """
    try:
        again = calibration_from(json.loads(text), [type(effect) for effect in calibration.model.effects])
        for name in ("z", "z_spread", "T_tracker_base", "T_tool_target"):
            if not np.array_equal(getattr(again, name), getattr(calibration, name)):
                raise TaskcalError(f"'{name}' is read back as something else")
    except TaskcalError as error:
        raise TaskcalError(f"the calibration is not written, for its file could not be read: {error}") from error


def _effect(number: int, described: Mapping[str, Any], kind: type[Effect] | None) -> Effect:
    """An effect of a file.

    Raises:
        TaskcalError: it is not known, comes from a module that is not imported, or its options are not its own.
    """
    try:
        if kind is None:
            return effect_from(described)
        return kind.from_json({name: value for name, value in described.items() if name not in ("kind", "module")})
    except KeyError as error:
        raise TaskcalError(f"effect {number} lacks {error}; it may have been edited: identify again") from error
    except (TypeError, ValueError, AttributeError) as error:
        message = f"effect {number} is none: {shown(error)}; it may have been edited: identify again"
        raise TaskcalError(message) from error
