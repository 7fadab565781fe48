"""Retrievals on synthetic imagery: from reflectances back to the aerosol that was specified.

With this package you invert the operator of `abi_operator` by nonlinear least squares, pixel by
pixel and with its exact derivatives, and score what comes out against the truth. `retrieve_smoke`
does so for the result of a simulation; `StateVector`, `ForwardModel` and `invert` are the parts of
which a retrieval of your own is made; `retrievals.scoring` holds the yardsticks.
"""

from .forward import ForwardModel as ForwardModel
from .forward import prepared as prepared
from .inverse import Inversion as Inversion
from .inverse import Minimiser as Minimiser
from .inverse import invert as invert
from .observation import Observation as Observation
from .observation import noise_sigma as noise_sigma
from .pixels import retrieve_pixels as retrieve_pixels
from .results import ResultCode as ResultCode
from .smoke import retrieve_smoke as retrieve_smoke
from .state_vector import Prior as Prior
from .state_vector import StateVector as StateVector
