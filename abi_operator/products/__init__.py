"""What users make of reflectances: pure functions on arrays, of NumPy or of JAX.

`derived_green` is the band that the imager lacks, by one of several published recipes, and
`nir_test` tells how much of it is near infrared. `corrected_colors` are red, green and blue with
the air taken out by `rayleigh_corrected`, in either order, and `natural_color` is a picture of
them, brightened by one of the enhancements. `fire_contrast` tells how a fire stands out.
"""

from .air_response import AirResponse as AirResponse
from .crefl import crefl_air as crefl_air
from .enhancement import cimss_stretch as cimss_stretch
from .enhancement import cira_stretch as cira_stretch
from .enhancement import crefl_stretch as crefl_stretch
from .enhancement import jma_true_color as jma_true_color
from .fire_contrast import fire_contrast as fire_contrast
from .fire_contrast import surrounding_mean as surrounding_mean
from .green import GREEN_RECIPES as GREEN_RECIPES
from .green import GreenRecipe as GreenRecipe
from .green import corrected_colors as corrected_colors
from .green import derived_green as derived_green
from .green import hybrid_green as hybrid_green
from .natural_color import natural_color as natural_color
from .nir_test import GreenChange as GreenChange
from .nir_test import green_change as green_change
from .nir_test import nir_test as nir_test
from .rayleigh_correction import air_response as air_response
from .rayleigh_correction import rayleigh_corrected as rayleigh_corrected
from .rayleigh_table import LOWEST_COSINE as LOWEST_COSINE
from .rayleigh_table import rayleigh_air as rayleigh_air
