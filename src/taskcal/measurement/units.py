"""Units of measurements, as instruments and people write them, alone or in a column's name."""

import re

LENGTHS = {"mm": 1e-3, "m": 1.0, "um": 1e-6, "cm": 1e-2, "in": 0.0254, "ft": 0.3048}
"""Metres in each unit of length."""

ANGLES = {"deg": 0.017453292519943295, "rad": 1.0, "mrad": 1e-3, "gon": 0.015707963267948967}
"""Radians in each unit of angle."""

FARTHEST = 100.0
"""Largest coordinate of a measurement, metres: beyond any robot, and the range of the instruments that measure one."""

TIMES = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
"""Seconds in each unit of time."""

LONGEST_NAME = 200
"""Letters of a column's name that may mean something; longer ones are text."""

UNITS = {
    "mm": "mm", "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "millimetres": "mm",
    "m": "m", "meter": "m", "meters": "m", "metre": "m", "metres": "m",
    "um": "um", "µm": "um", "μm": "um", "micron": "um", "microns": "um", "cm": "cm",
    "in": "in", "inch": "in", "inches": "in", "ft": "ft", "foot": "ft", "feet": "ft",
    "deg": "deg", "degree": "deg", "degrees": "deg", "°": "deg", "grad": "deg", "gon": "gon",
    "rad": "rad", "radian": "rad", "radians": "rad", "mrad": "mrad",
    "c": "C", "°c": "C", "degc": "C", "celsius": "C",
    "s": "s", "sec": "s", "seconds": "s", "ms": "ms", "min": "min", "h": "h",
}  # fmt: skip
"""Units as people write them. A German "Grad" is a degree; instruments on robots do not write the hundredth of a right angle."""


def split_unit(name: str) -> tuple[str, str | None]:
    """A column's name in small letters, its words parted by one blank, and its unit where it ends with one; nothing of a text."""
    if len(name) > LONGEST_NAME:
        return "", None
    text = name.strip().casefold()
    bracketed = re.fullmatch(r"(.*?)\s*[\[({<]\s*([^\])}>]*?)\s*[\])}>]\s*", text)
    unit: str | None = None
    if bracketed and bracketed[2] in UNITS:
        text, unit = bracketed[1], UNITS[bracketed[2]]
    text = " ".join(word for word in re.split(r"[\s_\-./,:]+(?!$)|[\s_\-./,:]+$", text) if word) or text
    words = text.split(" ")
    if unit is None and len(words) > 1 and words[-1] in UNITS and not (words[-1] == "grad" and len(words) == 1):
        unit = UNITS[words[-1]]
        words = words[:-1]
        if words and words[-1] == "in" and len(words) > 1:
            words = words[:-1]
    return " ".join(words), unit
