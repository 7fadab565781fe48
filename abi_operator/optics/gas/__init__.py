"""Absorption by gases: ozone, vapour, carbon dioxide, methane, nitrous oxide, oxygen, nitrogen.

`gas_absorption` gives the optical depth of the layers of one column in one band, one grey term or
the terms of an exponential sum; `transmittance` of what it gives is that of the direct beam.
"""

from .absorption import ALL_GASES as ALL_GASES
from .absorption import gas_absorption as gas_absorption
from .absorption import num_terms as num_terms
from .absorption import transmittance as transmittance
