"""Every form in which calibrated robots are written, by the name that the command line has for it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float

from taskcal.errors import UnknownName
from taskcal.export.c_source import export_c
from taskcal.export.camera import export_camera_info, export_camera_toml, export_camera_urdf, export_opencv_yaml
from taskcal.export.descriptions import NAMES, Form, export_description
from taskcal.export.forms import Export, export_dh, export_flexiv_yaml, export_ur_yaml, export_xarm_yaml
from taskcal.identification.calibration import Calibration
from taskcal_groundwork.plugins import load_plugins, state_faults

Writer = Callable[[Calibration, Float[np.ndarray, "n joints"] | None, bool], Export]


@dataclass(frozen=True, kw_only=True)
class Exporter:
    """Writes calibrated robots as files of one form."""

    name: str
    """What ``--form`` calls it; no other exporter has it."""
    folder: Callable[[Calibration, str], Export] | None = None
    """Of a form that is a folder and loses nothing: its files, given its name, with which all names in it begin; `write` is then
    not asked."""
    write: Writer
    """The file of a calibration. The second argument is joint positions at which a loss is measured, radians or metres, or None
    for all over the ranges; the third whether to write it although it loses something. That the calibration knows something of
    these poses was seen to before.

    Raises:
        TaskcalError: the form cannot hold the robot, or loses something that is not accepted (`Loss.refuse`).
    """
    camera: Callable[[Calibration, str | None], Export] | None = None
    """Of a form that holds a camera alone: its file, given the camera's name, None for the only one; `write` is then not asked."""
    description: Form | None = None
    """Of links and joints, which may have meshes and samples (`export_description`, `export_samples`): the form's name there."""


GROUP = "taskcal.exporters"
"""Entry points of other packages: an `Exporter` each."""

_EXPORTERS: dict[str, Exporter] = {
    name: Exporter(
        name=name,
        write=lambda one, q, accept, export=export: export(one, q=q, accept_loss=accept, accept_uncertain=True),
        description=name if name in NAMES else None,
    )
    for name, export in {
        **{form: partial(export_description, form=form) for form in NAMES},
        "ur-yaml": export_ur_yaml,
        "xarm-yaml": export_xarm_yaml,
        "flexiv-yaml": export_flexiv_yaml,
        "dh": partial(export_dh, convention="dh"),
        "mdh": partial(export_dh, convention="mdh"),
    }.items()
}


for _name, _python in (("c", False), ("cffi", True)):
    _EXPORTERS[_name] = Exporter(
        name=_name,
        folder=lambda one, prefix, python=_python: export_c(one, prefix=prefix, python=python),
        write=lambda one, _, __: export_c(one),
    )


for _name, _export in (
    ("camera-info", export_camera_info),
    ("opencv-yaml", export_opencv_yaml),
    ("camera-toml", export_camera_toml),
    ("camera-urdf", export_camera_urdf),
):
    _EXPORTERS[_name] = Exporter(name=_name, camera=_export, write=lambda one, _, __, export=_export: export(one))


def exporters() -> tuple[Exporter, ...]:
    """All of them, those of other packages behind Taskcal's own."""
    load_plugins(GROUP, Exporter, _EXPORTERS)
    return tuple(_EXPORTERS.values())


def exporter_of(name: str) -> Exporter:
    """The exporter of a form.

    Raises:
        UnknownName: there is none.
    """
    known = {one.name: one for one in exporters()}
    if name not in known:
        raise UnknownName("form", name, known, state_faults(GROUP))
    return known[name]
