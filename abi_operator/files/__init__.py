"""Files on disk, as Datasets in this project's names and SI units, and back.

Read a weather model's output (`read_wrf`, of several files `open_wrf_series`), the albedo of the
ground (`read_mcd43a1`), the picture of a plume (`read_plume`) and a table of fires (`read_fires`);
write and read the result of a scene (`ResultWriter`, `read_result`) in a folder that appears whole
or not at all (`output_folder`). A reader renames, converts units and orders axes as its file format
defines, and computes nothing else. Whatever is wrong with a file is an `InputError`, one sentence
that can be shown to the user.
"""

from .atomic import check_output_folder as check_output_folder
from .atomic import output_folder as output_folder
from .errors import InputError as InputError
from .fires import read_fires as read_fires
from .mcd43 import read_mcd43a1 as read_mcd43a1
from .mcd43 import read_white_sky as read_white_sky
from .netcdf import reading as reading
from .parts import Parts as Parts
from .plume import read_plume as read_plume
from .projection import projected as projected
from .result import ResultWriter as ResultWriter
from .result import note_files as note_files
from .result import noted_files as noted_files
from .result import read_result as read_result
from .stored import check_variables as check_variables
from .stored import rounded as rounded
from .stored import stored as stored
from .wrf import read_wrf as read_wrf
from .wrf import wrf_coordinates as wrf_coordinates
from .wrf_series import WrfSeries as WrfSeries
from .wrf_series import open_wrf_series as open_wrf_series
