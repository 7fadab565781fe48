r"""Light that particles larger than the wavelength diffract, apart from what geometric optics has.

A large particle takes twice its shadow out of the beam: one half is diffracted around it, all of it
scattered and nearly straight on, the other meets it and is reflected, refracted and absorbed. With
the single-scattering albedo :math:`\omega` of both the scattered light has the asymmetry factor

.. math:: g = D\,g_D + (1 - D)\,g_G, \qquad D = \frac{1}{2\omega},

that of geometric optics being :math:`g_G` (Fu [1]_, van Diedenhoven et al. [2]_). A phase function
of one lobe with this g would send what is diffracted sideways, and the more so the more a particle
absorbs: of crystals in C07 g is 0.95, and :math:`g_G` 0.5 to 0.75 as in every other band. So there
are two lobes, each of Henyey and Greenstein, as Key et al. [3]_ took for crystals.

*The diffracted lobe.* Behind a disc of size parameter x = 2 pi r / lambda the moments begin as
:math:`\chi_l = 1 - 2l/(\pi x)` (the overlap of two discs) and the phase function falls as
:math:`4/(\pi x\theta^3)` in the mean over its rings. The phase function of Henyey and Greenstein
with

.. math:: g_D = 1 - \frac{2}{\pi x}

does both. Of crystals x is that of the effective radius 3 V / (4 A).

References
----------
.. [1] Q. Fu, "A new parameterization of an asymmetry factor of cirrus clouds for climate models",
   J. Atmos. Sci., 64, 4140-4150, 2007, doi:10.1175/2007JAS2289.1
.. [2] B. van Diedenhoven et al., "A flexible parameterization for shortwave optical properties of
   ice crystals", J. Atmos. Sci., 71, 1763-1782, 2014, doi:10.1175/JAS-D-13-0205.1
.. [3] J. R. Key et al., "Parameterization of shortwave ice cloud optical properties for various
   particle habits", J. Geophys. Res., 107, 4181, 2002, doi:10.1029/2001JD000742
"""

import math

from jaxtyping import Array, Float

from .pointwise import choose


def diffracted_share(ssa: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Share D of scattered light that is diffracted: 1 / (2 ssa), and all of it below 1/2. [-]

    Parameters
    ----------
    ssa
        Single-scattering albedo of the particles. [-]
    """
    some = ssa > 0.5
    return choose(some, 0.5 / choose(some, ssa, 1.0), 1.0)


def diffraction_asymmetry(
    radius_um: Float[Array, "*n"], wavelength_um: float | Float[Array, ""]
) -> Float[Array, "*n"]:
    """Asymmetry factor of the diffracted lobe: 1 - lambda / (pi^2 r), of large particles. [-]

    Parameters
    ----------
    radius_um, wavelength_um
        Effective radius, above a tenth of the wavelength; wavelength. [um]
    """
    return 1 - wavelength_um / (math.pi**2 * radius_um)


def geometric_asymmetry(
    asymmetry: Float[Array, "*n"], ssa: Float[Array, "*n"], diffracted: Float[Array, "*n"]
) -> Float[Array, "*n"]:
    """Asymmetry factor of geometric optics, from that of all scattered light. [-]

    Parameters
    ----------
    asymmetry, ssa, diffracted
        Asymmetry factor of all light, single-scattering albedo above 1/2, and asymmetry factor of
        the diffracted lobe. [-]
    """
    share = diffracted_share(ssa)
    return (asymmetry - share * diffracted) / (1 - share)
