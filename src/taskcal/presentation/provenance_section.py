"""Where a calibration comes from, as a section of its page."""

from collections.abc import Mapping

from taskcal.identification.calibration import Calibration
from taskcal.measurement.registration import Registration
from taskcal.presentation.content import Section, Table


def provenance_section(calibration: Calibration) -> Section:
    """The section."""
    source = calibration.provenance
    rows = [
        ("robot", source.robot),
        ("robot file, digest", source.robot_digest),
        ("effects", ", ".join(effect.name for effect in calibration.model.effects) or "none"),
        ("residual field", "none" if calibration.field is None else f"of {len(calibration.field.q)} rows"),
        ("campaign", source.campaign),
        ("campaign, digest", source.campaign_digest),
        *(("campaign, as read", note) for note in source.notes),
        ("rows", str(source.rows)),
        ("registration", _registered(calibration.layout.registration)),
        ("made", source.created),
        ("by Taskcal", source.version),
        *((str(key), _words(value)) for key, value in source.options.items()),
        (
            "ended",
            f"{calibration.reason}; {calibration.iterations} iterations in the last of {calibration.rounds} rounds",
        ),
    ]
    return Section(
        title="Where it comes from",
        blocks=(Table.of_rows("Provenance", ("entry", "value"), rows, text_columns=(0, 1)),),
    )


def _registered(registration: Registration) -> str:
    """Where the fit's start of tracker frame and targets came from."""
    return f"from {registration.method}{f', {registration.file}' if registration.file else ''}"


def _words(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {item}" for key, item in value.items())  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, list | tuple):
        return ", ".join(str(item) for item in value) or "none"  # pyright: ignore[reportUnknownVariableType]
    return str(value)
