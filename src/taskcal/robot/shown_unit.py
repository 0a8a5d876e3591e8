"""Units of parameters as files, tables and figures show them; inside they are SI."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ShownUnit:
    """How values in a SI unit are shown."""

    name: str
    """``mm``, ``mrad``, ``mrad/m`` …"""
    factor: float
    """From the SI unit to this one."""

    @classmethod
    def of(cls, unit: str) -> "ShownUnit":
        """The shown unit of a SI unit: thousandths, or millionths per newton, newton metre or kelvin, of which there are many."""
        if unit.endswith(("/N", "/Nm", "/K")):
            return cls(f"µ{unit}", 1e6)
        return cls(f"m{unit}", 1e3)

    @property
    def key(self) -> str:
        """The same where names may only hold letters, as keys of JSON."""
        return self.name.replace("/", "_per_").replace("µ", "u").lower()

    @property
    def influence(self) -> str:
        """Unit of millimetres for one of it."""
        return f"mm/({self.name})" if "/" in self.name else f"mm/{self.name}"
