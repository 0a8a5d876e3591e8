"""How a target was observed without a tracker, as a calibration's file has it."""

from typing import Any

from taskcal.errors import TaskcalError, shown
from taskcal.measurement.observation import Observation, kind_of
from taskcal.toml_file import Finite, Section


class ObservationSection(Section):
    """How a target was observed without a tracker."""

    kind: str
    options: dict[str, Any]
    unknowns: list[Finite]

    def observation(self) -> Observation:
        """The kind, without rows.

        Raises:
            TaskcalError: there is no such kind, or its options are not its own.
        """
        kind = kind_of(self.kind)
        try:
            made = kind.of_description(self.options)
        except (KeyError, TypeError, ValueError) as error:
            raise TaskcalError(
                f"the options of its observation '{shown(self.kind)}' are none: {shown(error)}"
            ) from error
        if len(made.unknowns) != len(self.unknowns):
            raise TaskcalError(
                f"its observation '{self.kind}' has {len(self.unknowns)} unknowns, where {len(made.unknowns)} belong"
            )
        return made
