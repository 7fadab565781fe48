"""The ground beneath: its Lambertian albedo, band by band."""

from ..quantities import Quantity, itself, replaced
from ..transforms import Bounded


def albedo(band: str, sigma: float = 0.01) -> Quantity:
    """Lambertian albedo of the ground in a band, which the state knows to `sigma`. [-]"""
    return Quantity(
        f"albedo_{band}",
        "1",
        f"albedo of the ground in {band}",
        f"albedo.{band}",
        Bounded(0.0, 1.0),
        replaced,
        sigma=sigma / 0.09,  # the derivative of the transform is 0.09 at an albedo of 0.1
        get=itself,
    )
