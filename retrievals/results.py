"""What became of each pixel, as one code with a message that says what to try."""

import enum

import numpy as np


class ResultCode(enum.IntEnum):
    """Result of a retrieval at one pixel; only ``SUCCESS`` vouches for the value.

    It vouches for no small error but that of a plume's optical depth: other quantities are as well
    known as their posterior standard deviations say.
    """

    SUCCESS = 0
    NO_PLUME = 1
    UNUSABLE = 2
    INVALID_INPUT = 3
    NOT_CONVERGED = 4
    NONFINITE = 5
    POOR_FIT = 6
    MULTIPLE_SOLUTIONS = 7
    NOT_OBSERVABLE = 8
    TOO_FEW_BANDS = 9

    @property
    def message(self) -> str:
        """One sentence for the user."""
        return _MESSAGES[self]


_MESSAGES = {
    ResultCode.SUCCESS: "Retrieved.",
    ResultCode.NO_PLUME: (
        "Not attempted: there is no plume, no fire that stands out, or no cloud water to be "
        "retrieved here; where='all' attempts every usable pixel, but cloud needs cloud water."
    ),
    ResultCode.UNUSABLE: (
        "Not attempted: quality_flag reports night (no reason for fires), a grazing sun or view, a "
        "satellite out of sight, missing albedo, or an anisotropic ground that reflects less than "
        "nothing or more than all."
    ),
    ResultCode.INVALID_INPUT: (
        "Not attempted: no measurement (of fires: in the band in which they stand out, which "
        "where='all' does without), one that is no reflectance factor (above 2: in percent?), "
        "a sigma that is not above 0, or a prior that is not finite; repair the input."
    ),
    ResultCode.NOT_CONVERGED: (
        "The number of steps ran out; allow more, or give a prior where there may be no plume."
    ),
    ResultCode.NONFINITE: (
        "The operator was not finite at an iterate; look for impossible values in the scenario."
    ),
    ResultCode.POOR_FIT: (
        "No solution explains the measurements; the ground, cloud or aerosol assumed may be wrong, "
        "retrieving more of it may help, or it may be thicker than its limit."
    ),
    ResultCode.MULTIPLE_SOLUTIONS: (
        "Two solutions explain the measurements, and both are given; add a band or a prior."
    ),
    ResultCode.NOT_OBSERVABLE: (
        "The measurements hardly depend on what is retrieved (ground or cloud near critical "
        "albedo, or a very thick plume): the posterior error of optical depth exceeds the expected "
        "error, or that of something else is infinite; add a band or a prior."
    ),
    ResultCode.TOO_FEW_BANDS: (
        "Not attempted: fewer bands have values here, neither missing nor saturated, than there "
        "are unknowns; give a prior."
    ),
}


def flag_attributes() -> dict[str, object]:
    """CF attributes of a variable that holds result codes."""
    return {
        "flag_values": np.array([code.value for code in ResultCode], np.int8),
        "flag_meanings": " ".join(code.name.lower() for code in ResultCode),
        "comment": " ".join(f"{code.name.lower()}: {code.message}" for code in ResultCode),
    }


def expected_error(aod_550: np.ndarray) -> np.ndarray:
    """Expected error of aerosol optical depth over land, 0.05 + 0.15 aod_550 [1]_. [-]

    The envelope inside which two thirds of the retrievals of MODIS Dark Target lie: the yardstick
    of scores, and the posterior error above which a retrieval is not a success.

    References
    ----------
    .. [1] R. C. Levy et al., "Global evaluation of the Collection 5 MODIS dark-target aerosol
       products over land", Atmos. Chem. Phys., 10, 10399-10420, 2010,
       doi:10.5194/acp-10-10399-2010
    """
    return 0.05 + 0.15 * np.asarray(aod_550)
