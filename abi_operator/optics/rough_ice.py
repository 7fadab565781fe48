"""Asymmetry factor of crystals with rough faces, of many habits."""

from jaxtyping import Array, Float

from ..bands import AnyName
from .water import interpolate

# Asymmetry factor of the general habit mixture, severely roughened, at the centroids of GOES-16,
# against effective radius. [um], [-] (B. A. Baum et al., "Ice cloud single-scattering property
# models with the full phase matrix at wavelengths from 0.2 to 100 um", J. Quant. Spectrosc. Radiat.
# Transfer, 146, 123-139, 2014, doi:10.1016/j.jqsrt.2014.02.029, by the file of the radiation code
# ecRad (Apache-2.0), from which benchmarks/make_ice_tables.py prints it. With zero end slopes.)
EFFECTIVE_RADIUS_UM = (5, 7.5, 10, 15, 20, 25, 30, 40, 50, 60)
ASYMMETRY: dict[str, tuple[float, ...]] = {
    "C01": (0.7693, 0.7749, 0.7778, 0.7819, 0.7865, 0.7918, 0.7967, 0.8019, 0.8070, 0.8099),
    "green": (0.7706, 0.7764, 0.7795, 0.7837, 0.7885, 0.7941, 0.7989, 0.8042, 0.8092, 0.8121),
    "C02": (0.7722, 0.7773, 0.7805, 0.7849, 0.7898, 0.7954, 0.8003, 0.8055, 0.8106, 0.8134),
    "C03": (0.7738, 0.7782, 0.7816, 0.7864, 0.7915, 0.7975, 0.8028, 0.8081, 0.8133, 0.8160),
    "C04": (0.7815, 0.7818, 0.7850, 0.7910, 0.7967, 0.8033, 0.8092, 0.8156, 0.8213, 0.8244),
    "C05": (0.7884, 0.7895, 0.7944, 0.8044, 0.8137, 0.8239, 0.8331, 0.8451, 0.8550, 0.8607),
    "C06": (0.8196, 0.8112, 0.8118, 0.8185, 0.8256, 0.8338, 0.8410, 0.8501, 0.8580, 0.8626),
    "C07": (0.7927, 0.8090, 0.8272, 0.8584, 0.8831, 0.9052, 0.9216, 0.9366, 0.9442, 0.9433),
}


def rough_ice_asymmetry(
    effective_radius_um: Float[Array, "*n"], band: AnyName
) -> Float[Array, "*n"]:
    """Asymmetry factor of rough crystals, constant below 5 and above 60 um. [-]

    Parameters
    ----------
    effective_radius_um
        Effective radius, above 0. [um]
    band
        Name of the band.
    """
    return interpolate(effective_radius_um, EFFECTIVE_RADIUS_UM, ASYMMETRY, band)
