"""Radiative transfer of one column: layers, ground and directions in, reflectance out.

`toa_brf` is a discrete-ordinate solver in JAX for plane-parallel layers over a Lambertian ground,
with delta-M and exact single scattering, batched and differentiable in every input. It knows
nothing of aerosols, instruments or files.
"""

from .doublings import sufficient_doublings as sufficient_doublings
from .quadrature import double_gauss as double_gauss
from .single_scatter import cos_scattering_angle as cos_scattering_angle
from .toa_brf import toa_brf as toa_brf
