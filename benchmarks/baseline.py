"""The committed ratios, and how far a new one may lie above them."""

import json
from dataclasses import dataclass, field
from pathlib import Path

TOLERANCE = 2.0
"""Factor allowed above a ratio that is new to the baseline."""

GUARDED = 1.6
"""The same for ratios of processor times: a doubling fails, also where the ratio had fallen a little since."""


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A ratio of this run."""

    ratio: float
    seconds: float
    reference_seconds: float
    below: float | None
    """Its bound on any machine, whatever the baseline says."""


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """Ratios by name, each with its tolerance factor."""

    path: Path
    known: dict[str, dict[str, float]]
    renewed: bool
    """Whether this run replaces the ratios instead of being checked against them."""
    tolerance: float = TOLERANCE
    """Factor allowed above a ratio that is new to it."""
    measured: dict[str, Measured] = field(default_factory=dict[str, Measured])

    @classmethod
    def read(cls, path: Path, *, renewed: bool, tolerance: float = TOLERANCE) -> "Baseline":
        """Read the file; without one, nothing is known."""
        known = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        return cls(path=path, known=known, renewed=renewed, tolerance=tolerance)

    def record(self, key: str, measured: Measured) -> None:
        """Remember a ratio of this run."""
        self.measured[key] = measured

    def complaint(self, key: str, ratio: float, below: float | None = None) -> str | None:
        """What is wrong with a ratio; None if nothing is."""
        if below is not None and ratio >= below:
            return f"{key} is {ratio:.3g}, not below {below:g}"
        if self.renewed or key not in self.known:
            return None
        before, tolerance = self.known[key]["ratio"], self.known[key]["tolerance"]
        if ratio <= before * tolerance:
            return None
        return (
            f"{key} is {ratio:.3g}, more than {tolerance:g} times the {before:.3g} of {self.path.name}; "
            "if it should be, renew it with --renew-baseline, as benchmarks/README.md says"
        )

    def report(self) -> list[str]:
        """A line for each ratio of this run."""
        width = max(map(len, self.measured), default=0)
        lines: list[str] = []
        for key, now in self.measured.items():
            before = f"{self.known[key]['ratio']:.3g}" if key in self.known else "none"
            times = f"{now.seconds * 1e3:10.3f} ms over {now.reference_seconds * 1e3:10.3f} ms"
            bound = "" if now.below is None else f"  must be below {now.below:g}"
            lines.append(f"{key:{width}}  {now.ratio:8.3g}  baseline {before:>8}  {times}{bound}")
        return lines

    def write(self) -> None:
        """Put this run's ratios into the file, if it is to be renewed.

        Ratios that did not run keep their values; one that breaks its bound is no baseline.
        """
        if not (self.renewed and self.measured):
            return
        for key, now in self.measured.items():
            if self.complaint(key, now.ratio, now.below):
                continue
            tolerance = self.known.get(key, {}).get("tolerance", self.tolerance)
            self.known[key] = {"ratio": float(f"{now.ratio:.3g}"), "tolerance": tolerance}
        text = json.dumps(dict(sorted(self.known.items())), indent=2, ensure_ascii=False)
        self.path.write_text(text + "\n", encoding="utf-8")
