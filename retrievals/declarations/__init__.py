"""State vectors that are shipped: smoke, ash, dust, liquid cloud, fire, and the ground beneath.

Each is a list of `Quantity`; one of your own is another list. Priors are wide, meant to be replaced
by what is known of a scene (`StateVector.prior`, or the command's ``--prior``).
"""

from .clouds import liquid_cloud as liquid_cloud
from .clouds import mean_droplet_radius_um as mean_droplet_radius_um
from .clouds import optical_thickness as optical_thickness
from .clouds import with_droplet_radius as with_droplet_radius
from .clouds import with_optical_thickness as with_optical_thickness
from .fires import STEFAN_BOLTZMANN as STEFAN_BOLTZMANN
from .fires import assumed_of_fire as assumed_of_fire
from .fires import emitted_power as emitted_power
from .fires import fire as fire
from .ground import albedo as albedo
from .plumes import AOD_LIMIT as AOD_LIMIT
from .plumes import SCANNED_AOD_550 as SCANNED_AOD_550
from .plumes import WithEffectiveRadius as WithEffectiveRadius
from .plumes import aod_550 as aod_550
from .plumes import assumed_of_plume as assumed_of_plume
from .plumes import effective_radius_um as effective_radius_um
from .plumes import height_shift as height_shift
from .plumes import lifted as lifted
from .plumes import plume as plume
from .plumes import ssa_shift as ssa_shift
from .plumes import with_aod_550 as with_aod_550
