"""Whether anything moved while it was measured, and how well poses repeat: figures of a campaign over its rows."""

from contextlib import suppress

import numpy as np
import plotly.graph_objects as go

from taskcal.errors import CampaignError
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.drift import compensate_drift
from taskcal.measurement.repeated_poses import RepeatedPoses, pose_repeatability
from taskcal.presentation.theme import BLUE, SERIES, styled
from taskcal.studio.controls import facts, message, text
from taskcal.studio.figure_view import figure
from taskcal.studio.texts import Texts


def show_course(campaign: Campaign, texts: Texts) -> None:
    """Show reference points over the rows and the scatter of poses that recur, each where there is any."""
    text("h2", texts("course.title"))
    repeated: RepeatedPoses | None = None
    with suppress(CampaignError):
        repeated = pose_repeatability(campaign)
    if campaign.reference_points:
        for remark in compensate_drift(campaign).remarks:
            message(remark, fine=True)
        figure(texts("course.drift"), draw_drift(campaign, texts), texts("course.drift_note"))
    if repeated is not None:
        said = repeated.summary()
        facts(
            [
                (texts("course.repeated"), str(said["poses"])),
                (texts("course.rp"), f"{said['RP_l_mean_mm']:.3f}, {said['RP_l_max_mm']:.3f} mm"),
            ]
        )
        figure(texts("course.scatter"), draw_repeatability(repeated, texts), texts("course.scatter_note"))
    if repeated is None and not campaign.reference_points:
        text("p", texts("course.no_references")).classes("quiet")


def draw_drift(campaign: Campaign, texts: Texts) -> go.Figure:
    """How far every reference point is from its median place, row by row."""
    drawn = go.Figure()
    for k, (name, points) in enumerate(campaign.reference_points.items()):
        away = np.linalg.norm(points - np.nanmedian(points, axis=0), axis=1) * 1e3
        drawn.add_scatter(
            x=np.arange(len(points)),
            y=away,
            mode="markers",
            name=name,
            marker={"color": SERIES[k % len(SERIES)], "size": 6, "symbol": k},
        )
    styled(drawn, height=360)
    drawn.update_xaxes(title_text=texts("course.row"))
    return drawn.update_yaxes(title_text=texts("course.away"), rangemode="tozero")


def draw_repeatability(repeated: RepeatedPoses, texts: Texts) -> go.Figure:
    """The repeatability of every pose that recurs."""
    drawn = go.Figure()
    drawn.add_bar(
        x=[str(rows[0]) for rows in repeated.rows], y=repeated.repeatability * 1e3, marker={"color": BLUE}, name="RP"
    )
    styled(drawn, height=320, legend=False, top=20)
    drawn.update_xaxes(title_text=texts("course.row"), type="category")
    return drawn.update_yaxes(title_text="RP (mm)")
