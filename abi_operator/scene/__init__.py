"""Scenes: from a weather model's output to a scenario, its columns, and their simulated image.

`scenario` specifies one time of a scene: it completes the columns of a model Dataset to the top of
the atmosphere and adds ground, sun, satellite and plumes. `column_states` makes of it, and
`states_of_result` of a result that is read back, the states that the operator takes. `simulate`
adds radiances and reflectances, and `run` does so for scenes that do not fit into memory. No file
is opened here.
"""

from .account import COUNTED_OVER as COUNTED_OVER
from .account import add_accounts as add_accounts
from .account import negative_lines as negative_lines
from .albedo import check_ground as check_ground
from .angles import SATELLITE_LONGITUDE as SATELLITE_LONGITUDE
from .background import check_aod_550 as check_aod_550
from .background import check_background_aerosol as check_background_aerosol
from .cloud_optics import check_cloud_optics as check_cloud_optics
from .cloud_optics import check_ice_optics as check_ice_optics
from .cloud_optics import cloud_optics_of as cloud_optics_of
from .cloud_optics import ice_optics_of as ice_optics_of
from .column_air import completion_heights as completion_heights
from .column_air import highest_top as highest_top
from .columns import column_states as column_states
from .columns import states_of_result as states_of_result
from .condensate import CLASSES as CLASSES
from .condensate import check_classes as check_classes
from .condensate import classes_present as classes_present
from .droplet_number import DropletNumber as DropletNumber
from .emissivity import BY_LAND_USE as BY_LAND_USE
from .emissivity import Emissivity as Emissivity
from .emissivity import check_emissivity as check_emissivity
from .fires import check_fires as check_fires
from .fires import fires_inside as fires_inside
from .gases import check_gases as check_gases
from .gases import gases_of as gases_of
from .gases import has_hot_ground as has_hot_ground
from .grounds import OceanWind as OceanWind
from .grounds import check_ocean_wind as check_ocean_wind
from .hydrometeors import check_microphysics as check_microphysics
from .land import LandAlbedo as LandAlbedo
from .land import check_land_albedo as check_land_albedo
from .observed import observed as observed
from .run import row_blocks as row_blocks
from .run import run as run
from .scenario import check_absorption as check_absorption
from .scenario import scenario as scenario
from .sight import check_sight as check_sight
from .simulate import ERROR_BUDGET as ERROR_BUDGET
from .simulate import simulate as simulate
from .simulate import variables_of_result as variables_of_result
from .snow_and_ice import IceAlbedo as IceAlbedo
from .snow_and_ice import check_ice_albedo as check_ice_albedo
from .species import PlumeSpecification as PlumeSpecification
from .species import classes_of as classes_of
from .species import species_of as species_of
from .standard_profile import nearest_standard_atmosphere as nearest_standard_atmosphere
from .streams import most_streams as most_streams
from .sun import SUN_PATHS as SUN_PATHS
from .sun import sun_path_of as sun_path_of
