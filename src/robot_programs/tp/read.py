"""Reading TP programs with the frames and registers of a backup."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from robot_programs.core import se3
from robot_programs.core.errors import FileError
from robot_programs.core.program import Frame, Program, Visit, Waypoint
from robot_programs.core.robot import Robot
from robot_programs.core.source import Source
from robot_programs.tp.listing import Listing, is_variables, read_variables
from robot_programs.tp.resolve import Calls, Findings, Frames, Resolver, assigned, world_in_base
from robot_programs.tp.rewrite import Site, rewrite


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class TpProgram(Program):
    """What was read from listings."""

    robot: Robot
    sites: tuple[Site, ...]
    """Of the moves, in their order."""
    tool: Frame | None
    part: Frame | None
    unresolved: tuple[Visit, ...] = ()
    """Positions of motions that were not resolved."""

    def rewrite(self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> tuple[Source, ...]:
        """The program's files with some motions rewritten.

        Positions get new numbers where all motions that name one agree; where others still need the old ones, and in place of
        registers, the motion names a new position, which stands behind all others. Waypoints before the last become motions
        of their own in the lines before, and the lines behind are numbered anew.

        Args:
            robot: the robot, whose joint positions decide the configuration.
            waypoints: by number of the motion.

        Raises:
            InputError: a motion is to become one of another kind.
        """
        return rewrite(self.sources, self.sites, self.moves, robot, waypoints)

    def visits(self) -> Iterable[Visit]:
        """Motions of one listing that name one position, whatever shifts it; see `Program.visits`."""
        for number, (site, move) in enumerate(zip(self.sites, self.moves, strict=True)):
            for written in site.written:
                yield Visit(number=number, target=(site.file, written.name), place=move.place)
        yield from self.unresolved

    def reread(self, sources: tuple[Source, ...]) -> "TpProgram":
        """The program of other texts of the same files; see `Program.reread`."""
        return read_tp(sources, robot=self.robot, tool=self.tool, part=self.part)


def read_tp(
    sources: Sequence[Source], *, robot: Robot | None = None, tool: Frame | None = None, part: Frame | None = None
) -> TpProgram:
    """Read TP programs in their text form.

    Args:
        sources: listings (``.ls``), and for user frames, tools and registers the backup's ``sysframe.va`` and ``posreg.va``.
        robot: whose joints positions mean, and above whose base FANUC's world frame lies.
        tool: in the flange; for tools that the backup does not state.
        part: in the world; for user frames that the backup does not state.

    Raises:
        FileError: a file is no listing, none is one, or the robot is not given.
        InputError: FANUC's world frame is not known of such a robot.
    """
    listings = {i: Listing(source.text) for i, source in enumerate(sources) if not is_variables(source)}
    if not listings:
        raise FileError(sources[0].path, "holds variables only; pass the .ls with the motions, too")
    for i, listing in listings.items():
        _check(sources[i], listing)
    if robot is None:
        raise FileError(
            sources[0].path, "counts from FANUC's world frame, which lies at the height of axis 2; give the robot"
        )
    T_base_world = world_in_base(robot)
    own = {i: assigned(listing) for i, listing in listings.items()}
    frames = Frames(
        variables=read_variables(sources),
        T_base_world=T_base_world,
        changed_frames=frozenset[int | None]().union(*(a.frames for a in own.values())),
        changed_tools=frozenset[int | None]().union(*(a.tools for a in own.values())),
        tool=tool,
        part=part,
    )
    changed = frozenset[int | None]().union(*(a.registers for a in own.values()))
    calls = Calls.of(listings.values())
    findings = Findings()
    for i, listing in listings.items():
        Resolver(
            robot=robot,
            frames=frames,
            findings=findings,
            number=i,
            source=sources[i],
            listing=listing,
            assigned=own[i],
            changed_elsewhere=changed,
            calls=calls,
        ).run()
    return TpProgram(
        sources=tuple(sources),
        moves=tuple(findings.moves),
        diagnostics=tuple(findings.diagnostics),
        T_world_base=se3.inverse(T_base_world),
        base_from="FANUC's world frame, on axis 1 at the height of axis 2",
        robot=robot,
        sites=tuple(findings.sites),
        unresolved=tuple(findings.unresolved),
        tool=tool,
        part=part,
    )


def _check(source: Source, listing: Listing) -> None:
    """See that a file is a whole listing.

    Raises:
        FileError: it is not.
    """
    for section in ("MN", "POS"):
        if section not in listing.sections:
            hint = (
                "it is binary; save the program as text (.ls)" if "\0" in source.text else f"it has no line /{section}"
            )
            raise FileError(source.path, f"is no listing of a TP program: {hint}")
    fault = listing.fault()
    if fault is not None:
        raise FileError(source.path, fault[1], line=source.line(fault[0]))
