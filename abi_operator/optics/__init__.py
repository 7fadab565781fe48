"""What the matter of one column does to light in one band.

Each producer reads an `Atmosphere` and a `Band` and returns `OpticalProperties`, with one grey
term and layers from the top: `rayleigh` for air, `aerosol` for one plume, `liquid_cloud` for
droplets. They are added with ``+``; `column_optics` adds them all. `smoke` and `ash` make plumes
with published optics, every number of which can be replaced. The functions are written for one
column and know neither streams nor surface: batch them with `jax.vmap`.
"""

from .aerosol import aerosol as aerosol
from .cloud import liquid_cloud as liquid_cloud
from .column import column_optics as column_optics
from .droplets import effective_radius as effective_radius
from .phase import HenyeyGreenstein as HenyeyGreenstein
from .phase import RayleighPhase as RayleighPhase
from .rayleigh import rayleigh as rayleigh
from .species import ash as ash
from .species import smoke as smoke
