"""Asymmetry factor of geometric optics of crystals with rough faces, of many habits."""

from jaxtyping import Array, Float

from ..bands import AnyName
from .water import interpolate

# Asymmetry factor of what the general habit mixture, severely roughened, does not diffract
# (`diffraction`), at the centroids of GOES-16, against effective radius. [um], [-] (B. A. Baum et
# al., "Ice cloud single-scattering property models with the full phase matrix at wavelengths from
# 0.2 to 100 um", J. Quant. Spectrosc. Radiat. Transfer, 146, 123-139, 2014,
# doi:10.1016/j.jqsrt.2014.02.029: asymmetry factor and single-scattering albedo by the file of the
# radiation code ecRad (Apache-2.0), from which benchmarks/make_ice_tables.py prints it. With zero
# end slopes.)
EFFECTIVE_RADIUS_UM = (5, 7.5, 10, 15, 20, 25, 30, 40, 50, 60)
GEOMETRIC_ASYMMETRY: dict[str, tuple[float, ...]] = {
    "C01": (0.5482, 0.5562, 0.5604, 0.5670, 0.5755, 0.5856, 0.5950, 0.6051, 0.6150, 0.6207),
    "green": (0.5525, 0.5602, 0.5646, 0.5712, 0.5799, 0.5903, 0.5998, 0.6097, 0.6196, 0.6251),
    "C02": (0.5574, 0.5632, 0.5675, 0.5741, 0.5828, 0.5934, 0.6028, 0.6126, 0.6225, 0.6279),
    "C03": (0.5652, 0.5681, 0.5720, 0.5787, 0.5874, 0.5986, 0.6085, 0.6184, 0.6283, 0.6335),
    "C04": (0.5906, 0.5818, 0.5832, 0.5903, 0.5991, 0.6106, 0.6213, 0.6324, 0.6428, 0.6481),
    "C05": (0.6056, 0.5948, 0.5972, 0.6078, 0.6202, 0.6356, 0.6501, 0.6677, 0.6826, 0.6900),
    "C06": (0.6831, 0.6502, 0.6427, 0.6466, 0.6554, 0.6679, 0.6793, 0.6929, 0.7052, 0.7115),
    "C07": (0.6247, 0.6076, 0.6127, 0.6382, 0.6668, 0.6999, 0.7271, 0.7427, 0.7461, 0.7285),
}


def rough_ice_geometric_asymmetry(
    effective_radius_um: Float[Array, "*n"], band: AnyName
) -> Float[Array, "*n"]:
    """That of rough crystals, constant below 5 and above 60 um. [-]

    Parameters
    ----------
    effective_radius_um
        Effective radius, above 0. [um]
    band
        Name of the band.
    """
    return interpolate(effective_radius_um, EFFECTIVE_RADIUS_UM, GEOMETRIC_ASYMMETRY, band)
