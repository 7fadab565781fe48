"""What the matter of one column does to light in one band.

Each producer reads an `Atmosphere` and a `Band` and returns `OpticalProperties` with layers from
the top: `rayleigh` for air, `gas_absorption` for its gases, `aerosol` for one plume, `background`
for the aerosol beside plumes, `liquid_cloud` for droplets, `hydrometeor` for a class of any other
particles. They are added with ``+``; `column_optics` adds them all, and `mixture` is what a solver
reads of them. `smoke` and `ash` make plumes with published optics, every number of which can be
replaced, `mie_plume` one whose optics follow from the size of its particles. The functions read as
of one column, and a batch of columns has its axes behind those of every array; they know neither
streams nor surface.
"""

from .aerosol import aerosol as aerosol
from .aerosol import background as background
from .cloud import liquid_cloud as liquid_cloud
from .column import Mixture as Mixture
from .column import column_optics as column_optics
from .column import mixture as mixture
from .droplets import effective_radius as effective_radius
from .gamma import Habit as Habit
from .gas import ALL_GASES as ALL_GASES
from .gas import gas_absorption as gas_absorption
from .gas import num_terms as num_terms
from .gas import transmittance as transmittance
from .hydrometeor import from_effective_radius as from_effective_radius
from .hydrometeor import hydrometeor as hydrometeor
from .hydrometeor import outside_fitted_range as outside_fitted_range
from .hydrometeor import particle_radius as particle_radius
from .hydrometeor_classes import CLASSES as CLASSES
from .hydrometeor_classes import HABITS as HABITS
from .hydrometeor_classes import ClassOptics as ClassOptics
from .mie_aerosol import mie_optics as mie_optics
from .mie_phase import MiePhase as MiePhase
from .mie_table import mie_species as mie_species
from .phase import HenyeyGreenstein as HenyeyGreenstein
from .phase import RayleighPhase as RayleighPhase
from .phase import TwoTermHenyeyGreenstein as TwoTermHenyeyGreenstein
from .rayleigh import rayleigh as rayleigh
from .species import ash as ash
from .species import background_aerosol as background_aerosol
from .species import mie_plume as mie_plume
from .species import smoke as smoke
