"""The table of single parameters' effects over some poses."""

from taskcal.analysis.sensitivity import Sensitivity
from taskcal.presentation.content import Table


def tabulate_effects(sensitivities: Sensitivity) -> Table:
    """Largest and root mean square effect of every parameter: per unit, and for its tolerance."""
    raw = [
        *sensitivities.maximum(),
        sensitivities.maximum_in_space(),
        *sensitivities.rms_per_axis(),
        sensitivities.rms(),
    ]
    scaled = [
        *sensitivities.maximum(scaled=True),
        sensitivities.maximum_in_space(scaled=True),
        *sensitivities.rms_per_axis(scaled=True),
        sensitivities.rms(scaled=True),
    ]
    to_shown = sensitivities.to_shown()
    rows: list[tuple[str, ...]] = []
    for i, p in enumerate(sensitivities.model.parameters):
        rows.append(
            (
                p.label,
                p.shown.influence,
                *(f"{values[i] * to_shown[i]:.3f}" for values in raw),
                f"{p.tolerance * p.shown.factor:g} {p.shown.name}",
                *(f"{values[i] * 1e3:.3f}" for values in scaled),
            )
        )
    kinds = [f"{kind}\n{axis}" for kind in ("largest", "rms") for axis in ("X", "Y", "Z", "space")]
    return Table.of_rows(
        f"All {len(rows)} parameters in numbers",
        ("parameter", "unit", *kinds, "tolerance", *(f"{kind} mm" for kind in kinds)),
        rows,
        text_columns=(0, 1),
        note="Per unit of the parameter; then in mm for a defect of one tolerance (1σ).",
        folded=True,
    )
