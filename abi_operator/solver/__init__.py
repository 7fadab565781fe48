"""Radiative transfer of one column: layers, ground and directions in, light at the top out.

A discrete-ordinate solver in JAX for plane-parallel layers, batched and differentiable in every
input. `toa_brf` gives reflectances, `toa_radiance` radiances with thermal emission beside the sun,
`toa_albedo` the share of sunlight sent back, `surface_coupling` the reflectance as a closed form in
the ground's albedo, and `surroundings` what lies above and below layers that change. The ground is
an albedo or a `Surface` of your own. Callers whose phase functions are sharp pass them at the
scattering angle (`cos_scattering_angle`), from closed forms or from tables
(`interpolate_phase_function`, `mix_phase_functions`). How exactly to solve is told to all of them
by name (`Settings`). It knows nothing of aerosols, instruments or files.
"""

from .albedo import SurfaceCoupling as SurfaceCoupling
from .albedo import surface_coupling as surface_coupling
from .albedo import toa_albedo as toa_albedo
from .method.doublings import sufficient_doublings as sufficient_doublings
from .method.quadrature import double_gauss as double_gauss
from .method.quadrature import half_range as half_range
from .method.quadrature import on_double_gauss as on_double_gauss
from .method.single_scatter import cos_scattering_angle as cos_scattering_angle
from .method.slant_path import slant_path_secant as slant_path_secant
from .method.surface import AnySurface as AnySurface
from .method.surface import Lambertian as Lambertian
from .method.surface import Surface as Surface
from .phase_table import interpolate_phase_function as interpolate_phase_function
from .phase_table import mix_moments as mix_moments
from .phase_table import mix_phase_functions as mix_phase_functions
from .phase_table import moments_of_table as moments_of_table
from .phase_table import normalise_table as normalise_table
from .settings import Settings as Settings
from .surroundings import Surroundings as Surroundings
from .surroundings import surroundings as surroundings
from .toa_brf import toa_brf as toa_brf
from .toa_radiance import toa_radiance as toa_radiance
