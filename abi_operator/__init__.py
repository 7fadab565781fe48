"""Differentiable synthetic imagery of the GOES-R Advanced Baseline Imager.

With this package you write down what a column of the atmosphere holds (`State`: air, gases,
droplets and other particles, smoke, ash, a ground, a fire, a sun and a satellite) and get what the
imager would see in each band: `reflectance_factor` or `brf` of sunlight, `radiance` where heat
shines too. Exact derivatives with respect to everything in the state come by `jax.jacfwd`,
`jax.jacrev` and `jax.grad`. `abi_operator.solver` is the radiative transfer on its own;
`abi_operator.instrument` makes of radiances what a file would hold; `abi_operator.files` and
`abi_operator.scene` turn model output on disk into images. `use_full_speed` is for programs of your
own, under `jax.jit`, and `use_compilation_cache` compiles them once and not in every process.
"""

from . import _ending as _ending
from ._version import __version__ as __version__
from .atmosphere import Atmosphere as Atmosphere
from .atmosphere import BackgroundAerosol as BackgroundAerosol
from .atmosphere import Fire as Fire
from .atmosphere import Gases as Gases
from .atmosphere import Hydrometeor as Hydrometeor
from .atmosphere import LiquidCloud as LiquidCloud
from .atmosphere import MiePlume as MiePlume
from .atmosphere import Plume as Plume
from .atmosphere import State as State
from .bands import BANDS as BANDS
from .bands import GRASSO2013 as GRASSO2013
from .geometry import Geometry as Geometry
from .machine.speed import use_compilation_cache as use_compilation_cache
from .machine.speed import use_full_speed as use_full_speed
from .optics import ash as ash
from .optics import background_aerosol as background_aerosol
from .optics import mie_plume as mie_plume
from .optics import smoke as smoke
from .plume_edges import with_plume_edges as with_plume_edges
from .quality import outside_fitted_range as outside_fitted_range
from .quality import quality_flags as quality_flags
from .radiance import brightness_temperature as brightness_temperature
from .radiance import radiance as radiance
from .reflectance import brf as brf
from .reflectance import reflectance_factor as reflectance_factor
from .settings import Settings as Settings
from .standard_atmospheres import standard_atmosphere as standard_atmosphere
from .state_checks import check_state as check_state
