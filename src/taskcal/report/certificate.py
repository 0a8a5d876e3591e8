"""The certificate: one sheet to be signed, without figures; the report is its annex."""

from collections.abc import Mapping
from typing import Any

from taskcal.identification.calibration import Calibration
from taskcal.observations.base import TrackerNoise
from taskcal.report.calibration import describe_unobservable, say_option
from taskcal.report.content import Block, Facts, Numbers, Section, TextTable
from taskcal.report.page import Report
from taskcal.report.task import describe_task
from taskcal.report.verdict import verdict_blocks
from taskcal.task.task import Task

SIGNED = ("calibrated by", "checked by")

BLANK = "…" * 12
"""A line to write on."""


SHOWN = 16
"""Digits of a digest that are shown, as the robot's and the campaign's have; 64 bits tell any two files apart."""


def certificate_page(
    calibration: Calibration,
    verdict: Mapping[str, Any] | None,
    task: Task | None,
    digests: Mapping[str, str],
) -> Report:
    """Make the certificate of a calibration.

    Args:
        calibration: the calibration.
        verdict: over a task, where one was named, as `Verdict.summary` has it.
        task: that was named.
        digests: SHA-256 of the files that it is about, by their names; empty for one that was not found.
    """
    robot, source, held_out = calibration.model.robot, calibration.provenance, calibration.held_out
    blocks: list[Block | str] = []
    if verdict is None:
        blocks.append("No task was named, so that no tolerance is judged.")
    else:
        blocks += verdict_blocks(verdict)
    if held_out is None:
        blocks.append("No rows were held out: the error at other poses was not measured.")
    else:
        before, after = held_out.nominal_validation, held_out.validation
        blocks.append(
            Numbers(
                (f"{before.mean * 1e3:.3f}", "mm", "before: mean"),
                (f"{after.mean * 1e3:.3f}", "mm", "after: mean"),
                (f"{after.p95 * 1e3:.3f}", "mm", "after: 95th percentile"),
                (f"{after.maximum * 1e3:.3f}", "mm", "after: largest"),
            )
        )
        blocks.append(
            f"3D errors of {len(held_out)} rows that were not fitted, as measured: of the nominal robot, registered, and of the "
            "calibrated one."
        )
    blocks.append(
        "Intervals are of 95 %; uncertainty by JCGM 100:2008 (GUM), of the estimate and of what the model does not explain."
    )
    return Report(
        title="Certificate of calibration",
        sections=(Section("Result", *blocks), _validity(calibration, task, digests)),
        lead=f"{robot.title or robot.name}, {source.rows} rows of {source.campaign or 'a campaign'}, fitted {source.created[:10]}.",
    )


def _validity(calibration: Calibration, task: Task | None, digests: Mapping[str, str]) -> Section:
    """For what the certificate is valid (task, ranges, targets, files), and who says so."""
    source, noise = calibration.provenance, calibration.provenance.options.get("noise")
    stated = "as the rows state it"
    if isinstance(noise, Mapping) and noise.keys() == vars(TrackerNoise()).keys():
        stated = _say_noise(TrackerNoise(**noise))
    elif noise != "stated":
        stated = say_option(noise)
    measured, names = calibration.measured_range, calibration.model.robot.joint_names
    ranges = [f"{name} {measured.describe(j)}" for j, name in enumerate(names)]
    unsure = describe_unobservable(calibration.layout.registration)
    targets = [
        f"{name} {' '.join(f'{value:.3f}' for value in (1e3 * T[:3, 3]).round(3) + 0.0)} mm{doubt and f' ({doubt})'}"
        for name, T, doubt in zip(calibration.targets, calibration.T_tool_target, unsure, strict=True)
    ]
    facts = [
        *([] if task is None else [("task", describe_task(task))]),
        ("uncertainty of the instrument", stated),
        ("targets, in the tool frame", "; ".join(targets)),
        ("joint ranges", "; ".join(ranges)),
        ("robot file", f"digest {source.robot_digest}"),
        ("campaign", f"{source.campaign or 'unnamed'}, digest {source.campaign_digest}"),
        *(
            (file, f"SHA-256 {digest[:SHOWN]}…" if digest else "not found where it was written")
            for file, digest in digests.items()
        ),
    ]
    signed = TextTable.of_rows(
        "Signatures",
        ("", "name", "date", "signature"),
        [(role, BLANK, BLANK, BLANK) for role in SIGNED],
        text_columns=(0, 1, 2, 3),
    )
    return Section("Valid for", Facts(*facts), signed)


def _say_noise(noise: TrackerNoise) -> str:
    """Say what a tracker's points are off by."""
    along, across = (
        f"{fixed * 1e6:g} µm + {per * 1e6:g} µm/m"
        for fixed, per in ((noise.range_m, noise.range_per_m), (noise.transverse_m, noise.transverse_per_m))
    )
    return f"MPE {along} along the beam, {across} across; 1σ = {noise.mpe_to_sigma:.3g} MPE"
