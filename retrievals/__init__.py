"""Retrievals on synthetic imagery: from reflectances back to what was specified.

With this package you invert the operator of `abi_operator` by nonlinear least squares, pixel by
pixel and with its exact derivatives, and score what comes out against the truth. What is retrieved
is a `StateVector`, a list of `Quantity`: `declarations` has those of smoke, ash, dust, liquid
cloud, fire and ground, and one of your own is another list. `retrieve_image` inverts the result of
a simulation (`retrieve_kind` one of the shipped ones), `retrieve_pixels` any measurements
(`measurement`) and states; `ForwardModel` and `invert` are the parts of which both are made;
`retrievals.scoring` holds the yardsticks.
"""

from .fires import retrieve_fires as retrieve_fires
from .forward import ForwardModel as ForwardModel
from .forward import prepared as prepared
from .images import retrieve_image as retrieve_image
from .inverse import Inversion as Inversion
from .inverse import Minimiser as Minimiser
from .inverse import invert as invert
from .kinds import retrieve_kind as retrieve_kind
from .kinds import retrieve_smoke as retrieve_smoke
from .observation import Observation as Observation
from .observation import measurement as measurement
from .observation import noise_sigma as noise_sigma
from .pixels import retrieve_pixels as retrieve_pixels
from .prior import Prior as Prior
from .quantities import Derived as Derived
from .quantities import Quantity as Quantity
from .results import ResultCode as ResultCode
from .state_vector import StateVector as StateVector
from .transforms import Bounded as Bounded
from .transforms import Unbounded as Unbounded
