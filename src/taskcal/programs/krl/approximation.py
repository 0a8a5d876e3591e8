"""Where a KRL motion may be left for the next one: $APO, and who sets it.

KUKA's bas.src sets $APO from the parameter sets of the inline forms, and to DEF_APO_CDIS and DEF_APO_CPTP at BAS(#INITMOV).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from taskcal.programs.krl.expressions import number_of
from taskcal.programs.krl.lexer import Word
from taskcal.programs.krl.syntax import Aggregate, Assignment, Call
from taskcal.programs.krl.variables import Known
from taskcal.programs.program import MoveKind
from taskcal.programs.unresolved import Unresolved
from taskcal.programs.zone import THROUGH_TARGET, Zone

WHOLE_PERCENT = 200.0
"""At $APO.CPTP = 100 % approximation begins in the middle of the motion (KST PLC mxAutomation Logix, structure APO)."""


@dataclass(frozen=True, kw_only=True)
class Approximation:
    """What $APO holds; None where the text does not tell."""

    distance: float | None = None
    """CDIS, millimetres."""
    share: float | None = None
    """CPTP, percent."""

    def zone(self, passing: Sequence[str], kind: MoveKind) -> Zone | None:
        """How near a motion passes by its target; None where the text does not tell.

        Args:
            passing: its words for that.
            kind: of the motion.
        """
        words = set(passing)
        if not words:
            return THROUGH_TARGET
        if words <= {"C_DIS", "C_SPL"}:
            distance = self.distance
            return None if distance is None else Zone(distance=distance / 1e3, turn_distance=distance / 1e3)
        if words == {"C_PTP"} and kind in ("joint", "axes") and self.share is not None:
            return Zone(distance=math.inf, angle=math.inf, share=self.share / WHOLE_PERCENT)
        return None  # from which speed or orientation on is not a place that the text gives

    def after_assignment(self, line: Assignment, known: Known) -> "Approximation":
        """Behind an assignment."""
        match line.name:
            case "$APO.CDIS":
                return replace(self, distance=_size(line.words, known))
            case "$APO.CPTP":
                return replace(self, share=_size(line.words, known))
            case "$APO":
                part = line.value.parts[0] if len(line.value.parts) == 1 else None
                if not isinstance(part, Aggregate):
                    return Approximation()
                own, other = part.value("CDIS"), part.value("CPTP")
                return Approximation(
                    distance=self.distance if own is None else own, share=self.share if other is None else other
                )
            case _:
                return self

    def after_bas(self, line: Call, known: Known) -> "Approximation":
        """Behind a call of BAS."""
        match line.command:
            case "#CP_PARAMS" | "#CP_DAT":
                return replace(self, distance=_component("LDAT_ACT", known)[0])
            case "#PTP_PARAMS" | "#PTP_DAT":
                size, mode = _component("PDAT_ACT", known)
                if mode is None:
                    return Approximation()
                return replace(self, distance=size) if mode == "#CDIS" else replace(self, share=size)
            case "#INITMOV":
                module = known.names.module
                distance, share = (known.data.number(name, module) for name in ("DEF_APO_CDIS", "DEF_APO_CPTP"))
                return Approximation(distance=_positive(distance), share=_positive(share))
            case _:
                return self

    def of_motion(self, name: str, words: Sequence[Word], known: Known) -> "Approximation":
        """For one motion, which sets some of it behind WITH."""
        if name == "$APO.CDIS":
            return replace(self, distance=_size(words, known))
        if name == "$APO.CPTP":
            return replace(self, share=_size(words, known))
        if name == "$APO":
            function = words[0].upper if len(words) > 2 and words[1].text == "(" else ""
            return Approximation(
                distance=_component(words[2].upper, known)[0] if function in ("SAPO", "SAPO_PTP") else None
            )
        return self


NOT_KNOWN = Approximation()


def _component(name: str, known: Known) -> tuple[float | None, str | None]:
    """Size and kind of approximation in a set of motion parameters (LDAT, PDAT); None where the text does not tell them."""
    try:
        value = known.value(name)
    except Unresolved:
        return None, None
    if not isinstance(value, Aggregate):
        return None, None
    mode = value.field("APO_MODE")
    return _positive(value.value("APO_DIST")), "#CPTP" if mode is None else mode.text.upper()


def _size(words: Sequence[Word], known: Known) -> float | None:
    try:
        return _positive(number_of(words, known))
    except Unresolved:
        return None


def _positive(value: float | bool | None) -> float | None:
    return None if value is None or isinstance(value, bool) or value < 0.0 else float(value)
