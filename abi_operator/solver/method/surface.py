"""What the solver asks of a ground, and the plainest one, which it shares with other rooms."""

import abc
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ...lambertian import Lambertian as Lambertian


@runtime_checkable
class AnySurface(Protocol):
    """What the solver asks of a ground: the two methods of a `Surface`, subclass or not."""

    def brdf(self, mu_out: Any, mu_in: Any, relative_azimuth: Any) -> Any:
        """Reflectance factor between two directions, as `Surface.brdf` has it."""
        ...

    def modes(self, m: Any, mu_out: Any, mu_in: Any) -> Any:
        """Its azimuth mode m, as `Surface.modes` has it."""
        ...


class Surface(eqx.Module):
    r"""A reflecting ground.

    A subclass defines `brdf` and, if it knows a better way than the default, `modes`. Each of its
    array fields is one number per column (leading axes broadcast with those of the column's other
    arguments), so that methods are written for one column: angles come with the batch's axes last
    and meet the fields by trailing-axis broadcasting.

    The reflection must be reciprocal, ``brdf(a, b, phi) == brdf(b, a, phi)``, on which the solver's
    symmetric algebra rests, and must not reflect more light than falls in.
    """

    @abc.abstractmethod
    def brdf(
        self,
        mu_out: Float[Array, "*#shape"],
        mu_in: Float[Array, "*#shape"],
        relative_azimuth: Float[Array, "*#shape"],
    ) -> Float[Array, "*shape"]:
        r"""Bidirectional reflectance factor :math:`\pi f_r`; the albedo of a Lambertian ground.

        Parameters
        ----------
        mu_out, mu_in
            Cosines of the zenith angles of reflected and incident light, both above 0. [-]
        relative_azimuth
            0 where light is sent back to where it came from, pi in the glint. [rad]
        """

    @property
    def num_azimuths(self) -> int:
        """Number of azimuths in [0, pi] from which the default `modes` integrates."""
        return 64

    def modes(
        self,
        m: int | Int[Array, ""],
        mu_out: Float[Array, "*#shape"],
        mu_in: Float[Array, "*#shape"],
    ) -> Float[Array, "*shape"]:
        r"""Azimuth mode m of :math:`\rho = \sum_m (2-\delta_{m0})\rho_m\cos(m\Delta\phi)`.

        The default is the midpoint rule, :math:`\rho_m \approx \frac1K\sum_k
        \rho(\Delta\phi_k)\cos(m\Delta\phi_k)`, :math:`\Delta\phi_k = \pi(k+\frac12)/K` with K =
        `num_azimuths`. For a periodic even function it is exact but for aliases, the modes 2K - m,
        2K + m, 4K - m ... with alternating sign: its error is the size of mode 2K - m, which for
        an analytic reflectance falls off exponentially.
        """
        count = self.num_azimuths
        mu_out, mu_in = jnp.broadcast_arrays(mu_out, mu_in)
        azimuth = np.pi * (np.arange(count) + 0.5) / count
        shape = (count,) + (1,) * mu_out.ndim
        nodes = jnp.asarray(azimuth, mu_out.dtype).reshape(shape)
        values = self.brdf(mu_out[None], mu_in[None], nodes)
        order = jnp.asarray(m).astype(mu_out.dtype)
        return jnp.tensordot(jnp.cos(order * nodes.ravel()) / count, values, axes=1)
