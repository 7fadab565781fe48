"""The imager: from the radiance of columns to what a file would hold.

The order is that of the instrument and does not commute. A detector gathers light from its whole
footprint, so that radiance is averaged before anything saturates; temperature or reflectance is
made last:

    radiance of columns, unlimited -> mean over the footprint -> noise -> ceiling -> quantisation
    -> reflectance factor or brightness temperature

`observe` does all of it for one pixel of one band, by the settings of an `Imager`, and
`observe_mean` all but the mean for any number of them; `image_mean` is the mean where pixels and
cells share their axes. The steps stand beside them as pure functions.
"""

from .ceiling import hard_ceiling as hard_ceiling
from .ceiling import range_ceiling as range_ceiling
from .ceiling import smooth_ceiling as smooth_ceiling
from .footprint import footprint_mean as footprint_mean
from .footprint import image_mean as image_mean
from .footprint import overlap_lengths as overlap_lengths
from .imager import IMAGER as IMAGER
from .imager import Imager as Imager
from .imager import Observation as Observation
from .imager import observe as observe
from .imager import observe_mean as observe_mean
from .noise import NOISE as NOISE
from .noise import Noise as Noise
from .noise import add_noise as add_noise
from .noise import calibration_gain as calibration_gain
from .noise import noise_deviation as noise_deviation
from .quantisation import quantise as quantise
from .quantisation import rounding_deviation as rounding_deviation
from .reflectance_factor import radiance_from_reflectance_factor as radiance_from_reflectance_factor
from .reflectance_factor import reflectance_factor_from_radiance as reflectance_factor_from_radiance
