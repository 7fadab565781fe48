"""Asymmetry factor of rain and drizzle."""

from jaxtyping import Array, Float

from ..bands import AnyName
from .water import interpolate

# Asymmetry factor of exponential distributions (nu = 0) of spheres of water, against effective
# radius. [um], [-] (Mie theory, miepython 3.3, 6000 diameters in 0.5-15000 um equidistant in their
# logarithm, by benchmarks/make_water_tables.py; 10 um is there so that its zero slope costs nothing
# from 20 um on. Shapes up to nu = 2 have more by 0.002 in the visible, 0.004 in C06, 0.009 in C07.)
EFFECTIVE_RADIUS_UM = (10, 20, 30, 50, 75, 100, 150, 200, 300, 500, 750, 1000, 1500, 2000)
# fmt: off
ASYMMETRY: dict[str, tuple[float, ...]] = {
    "C01": (
        0.85919, 0.86885, 0.87249, 0.87564, 0.87733, 0.87822, 0.87916, 0.87965, 0.88016,
        0.88058, 0.88078, 0.88088, 0.88099, 0.88103,
    ),
    "green": (
        0.85818, 0.86916, 0.87329, 0.87692, 0.87890, 0.87996, 0.88106, 0.88163, 0.88222,
        0.88270, 0.88294, 0.88306, 0.88318, 0.88324,
    ),
    "C02": (
        0.85652, 0.86869, 0.87340, 0.87754, 0.87979, 0.88098, 0.88225, 0.88291, 0.88358,
        0.88414, 0.88442, 0.88457, 0.88474, 0.88483,
    ),
    "C03": (
        0.85152, 0.86672, 0.87259, 0.87780, 0.88068, 0.88222, 0.88387, 0.88475, 0.88570,
        0.88657, 0.88712, 0.88748, 0.88800, 0.88842,
    ),
    "C04": (
        0.84134, 0.86292, 0.87201, 0.88090, 0.88671, 0.89051, 0.89584, 0.89985, 0.90620,
        0.91580, 0.92487, 0.93198, 0.94246, 0.94969,
    ),
    "C05": (
        0.83741, 0.86126, 0.87151, 0.88157, 0.88817, 0.89252, 0.89861, 0.90317, 0.91029,
        0.92083, 0.93046, 0.93778, 0.94814, 0.95493,
    ),
    "C06": (
        0.83879, 0.86550, 0.87912, 0.89356, 0.90374, 0.91071, 0.92061, 0.92783, 0.93831,
        0.95137, 0.96058, 0.96590, 0.97131, 0.97373,
    ),
    "C07": (
        0.80993, 0.85163, 0.87766, 0.90701, 0.92691, 0.93889, 0.95223, 0.95903, 0.96521,
        0.96891, 0.97006, 0.97042, 0.97062, 0.97067,
    ),
}
# fmt: on


def rain_asymmetry(effective_radius_um: Float[Array, "*n"], band: AnyName) -> Float[Array, "*n"]:
    """Asymmetry factor of raindrops, constant below 10 um and above 2 mm. [-]

    Large drops absorb what they refract in the near infrared, and what is left is diffracted or
    reflected forwards.

    Parameters
    ----------
    effective_radius_um
        Effective radius, above 0. [um]
    band
        Name of the band.
    """
    return interpolate(effective_radius_um, EFFECTIVE_RADIUS_UM, ASYMMETRY, band)
