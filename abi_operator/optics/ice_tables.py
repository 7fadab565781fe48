"""Ice in the ABI bands: refractive index, shapes of crystals, and the fits of Fu (1996)."""

from typing import NamedTuple

from jaxtyping import Array

from .gamma import Habit, mitchell

# Density of ice. [kg m-3]
ICE_DENSITY = 917.0

# n - ik of ice at the centroids of GOES-16. [-] (S. G. Warren and R. E. Brandt, "Optical constants
# of ice from the ultraviolet to the microwave: a revised compilation", J. Geophys. Res., 113,
# D14220, 2008, doi:10.1029/2007JD009744; n interpolated linearly, k log-log, from the tables of
# refractiveindex.info, CC0)
ICE_INDEX: dict[str, complex] = {
    "C01": 1.3144 - 2.040e-10j,
    "green": 1.3108 - 2.550e-9j,
    "C02": 1.3083 - 1.212e-8j,
    "C03": 1.3038 - 2.358e-7j,
    "C04": 1.2945 - 1.511e-5j,
    "C05": 1.2891 - 2.715e-4j,
    "C06": 1.2589 - 2.031e-4j,
    "C07": 1.3702 - 9.251e-3j,
}

# Mass and projected area of crystals longer than 100 um, by their longest dimension. [g, cm2, cm]
# (D. L. Mitchell, "Use of mass- and area-dimensional power laws for determining precipitation
# particle terminal velocities", J. Atmos. Sci., 53, 1710-1723, 1996, table 1,
# doi:10.1175/1520-0469(1996)053<1710:UOMAAD>2.0.CO;2; plates and columns in the form that the
# radiation code SOCRATES gives them)
CRYSTALS: dict[str, Habit] = {
    "columns": mitchell(0.00166, 1.91, 0.0459, 1.415, ICE_DENSITY),
    "plates": mitchell(0.00739, 2.45, 0.2395, 1.855, ICE_DENSITY),
    "rosettes": mitchell(0.00308, 2.26, 0.0869, 1.57, ICE_DENSITY),
    "planar_polycrystals": mitchell(0.00739, 2.45, 0.2285, 1.88, ICE_DENSITY),
    "aggregates": mitchell(0.0028, 2.1, 0.2285, 1.88, ICE_DENSITY),
}


class Fu(NamedTuple):
    """Fits in the generalized effective size D of one band, D in um.

    Parameters
    ----------
    extinction
        a0 and a1 of the mass extinction coefficient a0 + a1 / D. [m2 g-1], [m2 g-1 um]
    coalbedo, asymmetry
        Coefficients of 1, D, D^2, D^3. [-], [um-1], ...
    """

    extinction: tuple[float | Array, ...]
    coalbedo: tuple[float | Array, ...]
    asymmetry: tuple[float | Array, ...]


# Generalized effective sizes for which the fits hold. [um]
FU_RANGE_UM = (20.0, 130.0)
# Of the intervals that contain the centroids of GOES-16: 0.44-0.48, 0.52-0.57, 0.57-0.64,
# 0.78-0.87, 1.19-1.41, 1.53-1.64, 2.13-2.38, 3.42-4.00 um (Q. Fu, "An accurate parameterization of
# the solar radiative properties of cirrus clouds for climate models", J. Climate, 9, 2058-2082,
# 1996, doi:10.1175/1520-0442(1996)009<2058:AAPOTS>2.0.CO;2; digits as libRadtran 2.0.3 carries
# them).
FU: dict[str, Fu] = {
    "C01": Fu(
        (1.29121e-4, 2.50410),
        (7.10418e-7, 1.42205e-8, 1.99874e-10, -7.81101e-13),
        (0.748613, 8.90545e-4, -3.44038e-7, -1.10117e-8),
    ),
    "green": Fu(
        (-3.03108e-5, 2.51805),
        (9.89368e-8, 5.44286e-8, -1.00877e-10, 4.56410e-13),
        (0.751135, 9.09208e-4, -6.34939e-7, -9.84390e-9),
    ),
    "C02": Fu(
        (9.82244e-5, 2.50875),
        (-8.93276e-8, 1.14916e-7, -1.62990e-10, 6.53291e-13),
        (0.752131, 9.37763e-4, -9.72292e-7, -8.62063e-9),
    ),
    "C03": Fu(
        (8.10443e-5, 2.51619),
        (-1.57963e-7, 1.72475e-6, 9.02156e-11, -3.79423e-13),
        (0.752318, 1.04224e-3, -2.26618e-6, -3.68283e-9),
    ),
    "C04": Fu(
        (6.51659e-5, 2.51660),
        (-1.48012e-7, 9.02355e-5, -1.98190e-8, 4.01914e-11),
        (0.751277, 1.29824e-3, -4.99075e-6, 6.33757e-9),
    ),
    "C05": Fu(
        (6.44675e-4, 2.47060),
        (2.01931e-3, 1.83364e-3, -7.00232e-6, 1.84287e-8),
        (0.751497, 2.05963e-3, -1.12135e-5, 2.73998e-8),
    ),
    "C06": Fu(
        (4.89477e-4, 2.48776),
        (5.83469e-4, 1.18127e-3, -3.40011e-6, 8.78549e-9),
        (0.775916, 1.74517e-3, -9.21314e-6, 2.15003e-8),
    ),
    "C07": Fu(
        (1.87598e-4, 2.51396),
        (0.196793, 5.75235e-3, -5.29220e-5, 1.76618e-7),
        (0.759183, 4.93765e-3, -4.84059e-5, 1.65801e-7),
    ),
}
