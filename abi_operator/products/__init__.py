"""What users make of reflectances: pure functions on arrays, of NumPy or of JAX.

`derived_green` is the band that the imager lacks, `natural_color` a picture of all three colours.
"""

from .green import derived_green as derived_green
from .natural_color import natural_color as natural_color
