"""A KRL program: motions with the place of their numbers, to be rewritten there."""

from collections.abc import Mapping
from dataclasses import dataclass

from taskcal.programs.krl.rewriting import Site, rewrite
from taskcal.programs.program import Program, Waypoint
from taskcal.programs.source import Source
from taskcal.robot.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class KrlProgram(Program):
    """What was read from ``.src`` and ``.dat`` files."""

    sites: tuple[Site, ...]
    """Of the moves, in their order."""

    def rewrite(self, robot: Robot, ways: Mapping[int, tuple[Waypoint, ...]]) -> tuple[Source, ...]:
        """The program's files with some motions rewritten.

        Points of the program's own data list get new numbers there, or a copy beside them where other motions still need the old
        ones; all others are written into the motion itself. Waypoints before the last become motions of their own in the
        lines before.

        Args:
            robot: the robot, whose joint positions decide status and turn.
            ways: by number of the motion.
        """
        return rewrite(self.sources, self.sites, self.moves, robot, ways)
