"""Numbers of particles, where a cloud scheme gives their mass alone.

A model's microphysics scheme fixes, for each class of hydrometeor, how mass goes with diameter, the
shape of the size distribution, and either predicts the number of particles or implies it: by the
intercept of an exponential distribution, by the mass and temperature of snow. `SCHEMES` holds what
the schemes of WRF and RAMS assume; `number_concentration` and `number_path` apply it, smoothly, so
that number has a derivative with respect to mass and temperature. Every assumption can be replaced
by a closure of one's own (`FixedNumber`, `Intercept`, ...), whose numbers can be differentiated.
"""

from .closures import Closure as Closure
from .closures import FieldSnow as FieldSnow
from .closures import FixedNumber as FixedNumber
from .closures import IceMassPower as IceMassPower
from .closures import Intercept as Intercept
from .closures import Predicted as Predicted
from .closures import SnowIntercept as SnowIntercept
from .closures import ThompsonGraupel as ThompsonGraupel
from .gamma import MassLaw as MassLaw
from .number import droplet_shape as droplet_shape
from .number import number_concentration as number_concentration
from .number import number_path as number_path
from .schemes import SCHEMES as SCHEMES
from .schemes import SizeDistribution as SizeDistribution
from .schemes import own_droplet_number as own_droplet_number
from .schemes import size_distribution as size_distribution
