r"""Enhancements that make a picture of reflectances bright: published, and for display only.

Reflectances go in and the brightness of a screen, 0 to 1, comes out. All but the colour matrix
clip, so that their derivative is 0 where a picture is black or saturated: no quantity to be fitted
or differenced should come out of here. NaN stays NaN.
"""

import math
from typing import Any

import numpy as np
from jaxtyping import Array, Float

from ._arrays import namespace

# Reflectance that CIRA's stretch shows as black. [-] (satpy 0.60, `cira_stretch`)
_DARKEST = 0.0223
# CIMSS: brightest reflectance; slope of the contrast, f = a (c + 1) / (a - c) with a = 259 / 255
# and c = 0.1; what is shown as black. [-] (satpy 0.60, `cimss_true_color_contrast`)
_CIMSS_BRIGHTEST = 1.2
_CIMSS_CONTRAST = (259 / 255) * 1.1 / (259 / 255 - 0.1)
_CIMSS_DARKEST = 10 / 255
# Corners of the lines for corrected reflectance, in steps of 1/255 of reflectance and brightness.
# (Polar2Grid's scaling, as in satpy 0.60, `true_color_crefl`)
_CREFL_REFLECTANCE = (0.0, 25.0, 55.0, 100.0, 255.0)
_CREFL_BRIGHTNESS = (0.0, 90.0, 140.0, 175.0, 255.0)
# From red, green and blue of GOES-16 to those of an sRGB screen, a row for each that comes out. [-]
# (satpy 0.60, `jma_true_color_reproduction`, computed by the method of Murata et al., 2018)
_JMA_GOES16 = (
    (1.1425, 0.1819, -0.2250),
    (-0.0951, 0.9363, 0.1360),
    (-0.0113, -0.1179, 1.0621),
)


def cira_stretch(
    reflectance: Float[Array | np.ndarray, "*shape"],
) -> Float[Array | np.ndarray, "*shape"]:
    r"""Logarithmic stretch of CIRA, as satpy's ``cira_stretch`` does. [-]

    .. math:: y = \frac{\log_{10} R - \log_{10} 0.0223}{0.75\,(1 - \log_{10} 0.0223)}

    Clipped to 0..1, display only: reflectances below 0.0223 are black, and those above 2.17 white.

    Parameters
    ----------
    reflectance
        Bidirectional reflectance factor of one colour or of several. [-]
    """
    xp = namespace(reflectance)
    darkest = math.log10(_DARKEST)
    visible = xp.maximum(reflectance, _DARKEST)
    return xp.minimum((xp.log10(visible) - darkest) / (0.75 * (1 - darkest)), 1.0)


def cimss_stretch(
    reflectance: Float[Array | np.ndarray, "*shape"],
) -> Float[Array | np.ndarray, "*shape"]:
    r"""Square root and contrast of CIMSS. [-]

    .. math:: y = f\,(\sqrt{R / 1.2} - 0.5) + 0.5, \qquad f = \frac{a (c + 1)}{a - c},
       \quad a = 259 / 255,\ c = 0.1

    Clips three times, display only: R to 0..1.2, y from 1 on to 1, and y up to 10/255, which is a
    reflectance of 0.0180, to 0, with a jump there.

    Parameters
    ----------
    reflectance
        Bidirectional reflectance factor of one colour or of several. [-]

    References
    ----------
    .. [1] M. K. Bah, M. M. Gunshor and T. J. Schmit, "Generation of GOES-16 true color imagery
       without a green band", Earth Space Sci., 5, 549-558, 2018, doi:10.1029/2018EA000379
    """
    xp = namespace(reflectance)
    # Black anyway, and away from where the root has no derivative.
    scaled = xp.clip(reflectance / _CIMSS_BRIGHTEST, 1e-4, 1.0)
    shown = _CIMSS_CONTRAST * (xp.sqrt(scaled) - 0.5) + 0.5
    return xp.where(shown <= _CIMSS_DARKEST, 0, xp.minimum(shown, 1.0))


def crefl_stretch(
    reflectance: Float[Array | np.ndarray, "*shape"],
) -> Float[Array | np.ndarray, "*shape"]:
    """Four straight lines used with corrected reflectance ("crefl"). [-]

    255 R = 0, 25, 55, 100, 255 is shown as 255 y = 0, 90, 140, 175, 255. Clipped to 0..1, display
    only; the derivative jumps at the corners.

    Parameters
    ----------
    reflectance
        Bidirectional reflectance factor of one colour or of several. [-]
    """
    xp = namespace(reflectance)
    reflectances, brightness = np.array(_CREFL_REFLECTANCE), np.array(_CREFL_BRIGHTNESS)
    slopes = (np.diff(brightness) / np.diff(reflectances)).tolist()
    starts, widths = (reflectances[:-1] / 255).tolist(), (np.diff(reflectances) / 255).tolist()
    lines = zip(slopes, starts, widths, strict=True)
    shown: Any = sum(
        slope * xp.clip(reflectance - start, 0.0, width) for slope, start, width in lines
    )
    return shown


def jma_true_color(
    colours: Float[Array | np.ndarray, "*shape 3"],
) -> Float[Array | np.ndarray, "*shape 3"]:
    """Colours of GOES-16 as an sRGB screen should show them: JMA's true colour reproduction. [-]

    A matrix for each pixel, linear and not clipped, so that a saturated blue may give a slightly
    negative red. Done with the air corrected for and before a stretch, which satpy takes to be
    `cira_stretch`.

    Parameters
    ----------
    colours
        Red, green and blue reflectance on the last axis. [-]

    Raises
    ------
    ValueError
        If the last axis does not hold three colours.

    References
    ----------
    .. [1] H. Murata, K. Saitoh and Y. Sumida, "True color imagery rendering for Himawari-8 with a
       color reproduction approach based on the CIE XYZ color system", J. Meteor. Soc. Japan, 96B,
       211-238, 2018, doi:10.2151/jmsj.2018-049
    """
    if colours.ndim == 0 or colours.shape[-1] != 3:
        raise ValueError(f"colours need red, green and blue on the last axis; got {colours.shape}.")
    red, green, blue = (colours[..., k] for k in range(3))
    screen = [a * red + b * green + c * blue for a, b, c in _JMA_GOES16]
    return namespace(colours).stack(screen, axis=-1)
