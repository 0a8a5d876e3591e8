# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.export.controller_offsets import ControllerOffsets as ControllerOffsets
from taskcal.export.controller_offsets import fit_offsets as fit_offsets
from taskcal.export.dh_form import export_dh as export_dh
from taskcal.export.export import Export as Export
from taskcal.export.export import Loss as Loss
from taskcal.export.ur_form import export_ur_yaml as export_ur_yaml
from taskcal.export.urdf_form import export_urdf as export_urdf
