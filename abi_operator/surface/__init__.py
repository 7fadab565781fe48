"""Grounds: what sun and air see below them, and what leaves it by itself.

`Lambertian`, `RossLi` (land, with the kernel weights of the MODIS product), `Ocean` (glint,
foam and water) and `LandAndSea` (some of both) answer the two questions that a solver asks of a
ground, ``brdf(mu_out, mu_in, relative_azimuth)`` and its azimuth modes ``modes(m, mu_out, mu_in)``;
each of their fields is one number per column. `modis_to_abi` maps albedo between the imagers'
bands, `surface_emission` is the thermal light of a ground of which a part may burn, and `reported`
says where kernel weights describe no ground at all. `brightened` makes any of them reflect more.
"""

from ..lambertian import Lambertian as Lambertian
from .brightened import brightened as brightened
from .emission import EMISSIVITY_3900NM as EMISSIVITY_3900NM
from .emission import emissivity_3900nm as emissivity_3900nm
from .emission import surface_emission as surface_emission
from .energy import Report as Report
from .energy import directional_albedo as directional_albedo
from .energy import reported as reported
from .land_and_sea import LandAndSea as LandAndSea
from .land_use import LAND_USE as LAND_USE
from .modis_to_abi import MODIS_TO_ABI as MODIS_TO_ABI
from .modis_to_abi import modis_to_abi as modis_to_abi
from .ocean import Ocean as Ocean
from .ocean import ocean as ocean
from .ross_li import WHITE_SKY as WHITE_SKY
from .ross_li import RossLi as RossLi
from .snow_and_ice import SNOW_AND_ICE_ALBEDO as SNOW_AND_ICE_ALBEDO
from .snow_and_ice import snow_and_ice_albedo as snow_and_ice_albedo
