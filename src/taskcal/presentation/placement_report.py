"""Placements of a part as a page: the best ones, what they are worth, and a map of the region."""

from taskcal.correction.part_placement import PartPlacements
from taskcal.presentation.content import Block, Chart, Numbers, Section, Text
from taskcal.presentation.placement_figures import draw_placements, varied_axes
from taskcal.presentation.placement_tables import state_cost, state_placement, tabulate_obstacles, tabulate_placements
from taskcal.presentation.report import Page

MEANING = (
    "Expected errors are root mean squares in space over the targets. Before is the robot's error as it is known, with its "
    "uncertainty; corrected is that uncertainty alone, which no correction takes away; force is how far the stated force of the "
    "process deflects the tool. What decides is corrected, or before where there is no calibration, and force."
)

_MAPS = (
    "Dark is better for errors, bright for margins. Crosses cannot be executed whole or come near a singular posture; the circle "
    "is the best placement, through which the maps go."
)


def placement_page(found: PartPlacements, robot: str, *, calibrated: bool, version: str) -> Page:
    """The page of placements.

    Args:
        found: the placements.
        robot: its name.
        calibrated: whether a calibration stands behind them, rather than tolerances.
        version: of the package, for the footer.
    """
    ranked = found.ranked
    blocks: list[Block] = [Numbers(_numbers(found))]
    said = [f"As it stands: {state_placement(found.now)}."]
    if ranked:
        said += [f"Best: {state_placement(ranked[0])}.", f"It costs {state_cost(found.now, ranked[0])}."]
    blocks.append(Text((*said, MEANING)))
    if ranked:
        blocks.append(tabulate_placements(found))
    sections = [Section(title="Where to put it", blocks=tuple(blocks))]
    axes = varied_axes(found)
    if axes:
        through = ranked[0] if ranked else max(found.all, key=lambda placed: placed.reached)
        chart = Chart(
            title="What is to be expected over the region",
            least_width=700 if len(axes) > 2 else 0,
            figure=draw_placements(found, through),
            note=_MAPS
            if len(axes) > 1
            else "A gap: the program cannot be executed whole there, or comes near a singular posture.",
        )
        sections.append(Section(title="The region", blocks=(chart, *tabulate_obstacles(found))))
    source = "by its calibration" if calibrated else "by its tolerances, in its own base"
    return Page(
        title=f"Where to put {found.name}",
        sections=tuple(sections),
        lead=f"{len(found.all)} placements before the {robot}, {source}. {len(ranked)} can be executed whole, clear of singular "
        "postures. Collisions are not looked at.",
        footer=f"Taskcal {version}.",
    )


def _numbers(found: PartPlacements) -> tuple[tuple[str, str, str], ...]:
    items = [(f"{len(found.ranked)} of {len(found.all)}", "", "placements can be executed whole")]
    if found.ranked:
        best = found.ranked[0]
        items.append((f"{best.expected * 1e3:.3f}", "mm", "expected at the best"))
        items.append((f"{found.ranked[-1].expected * 1e3:.3f}", "mm", "expected at the worst of them"))
    if found.now.possible:
        items.append((f"{found.now.expected * 1e3:.3f}", "mm", "expected where it stands"))
    return tuple(items)
