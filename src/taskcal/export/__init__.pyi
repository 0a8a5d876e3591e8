# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.export.c_source import export_c as export_c
from taskcal.export.camera import export_camera_info as export_camera_info
from taskcal.export.camera import export_camera_toml as export_camera_toml
from taskcal.export.camera import export_camera_urdf as export_camera_urdf
from taskcal.export.camera import export_opencv_yaml as export_opencv_yaml
from taskcal.export.controller import ControllerOffsets as ControllerOffsets
from taskcal.export.controller import fit_offsets as fit_offsets
from taskcal.export.descriptions import draw_sample as draw_sample
from taskcal.export.descriptions import export_description as export_description
from taskcal.export.descriptions import export_samples as export_samples
from taskcal.export.descriptions import export_urdf as export_urdf
from taskcal.export.exporters import Exporter as Exporter
from taskcal.export.forms import Export as Export
from taskcal.export.forms import Loss as Loss
from taskcal.export.forms import export_dh as export_dh
from taskcal.export.forms import export_flexiv_yaml as export_flexiv_yaml
from taskcal.export.forms import export_ur_yaml as export_ur_yaml
from taskcal.export.forms import export_xarm_yaml as export_xarm_yaml
from taskcal.export.model_comparison import ModelComparison as ModelComparison
from taskcal.export.model_comparison import compare_model as compare_model
from taskcal.export.model_comparison import read_model as read_model
