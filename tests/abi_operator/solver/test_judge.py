"""Grounds, secants, thermal light and views against a 40-digit evaluation."""

import jax.numpy as jnp
import numpy as np
import pytest
from columns import standard_columns
from forty_digits import Ground, forty_digit_brf, forty_digit_radiance
from jaxtyping import Array, Float

from abi_operator.solver import (
    Lambertian,
    Surface,
    half_range,
    surface_coupling,
    toa_albedo,
    toa_brf,
    toa_radiance,
)

COUNT = 3
NUM_STREAMS = 4
# Rounding of float64, grown by some hundred matrix operations to 1.5e-14 where it is largest.
RIGHT = 1e-12
# Two ways to write the same ground differ by rounding in its azimuth modes only.
ROUNDING = 1e-12
# A ground's albedo, found again from a reflectance to which a thick cloud lets it add little.
SEEN_THROUGH = 1e-10
# Azimuths from which the judge integrates a mode; aliases of these smooth grounds are below 1e-16.
NUM_AZIMUTHS = 256


class Tilted(Surface):
    """Brighter towards backscatter: a + b cos(angle between sun and view)."""

    level: Float[Array, "*batch"]
    slope: Float[Array, "*batch"]

    def brdf(self, mu_out, mu_in, relative_azimuth):
        sines = jnp.sqrt((1 - mu_out**2) * (1 - mu_in**2))
        return self.level + self.slope * (mu_out * mu_in + sines * jnp.cos(relative_azimuth))

    def judged(self, i: int) -> Ground:
        level, slope = float(self.level[i]), float(self.slope[i])

        def brdf(mu_out, mu_in, azimuth):
            sines = np.sqrt((1 - mu_out**2) * (1 - mu_in**2))
            return level + slope * (mu_out * mu_in + sines * np.cos(azimuth))

        def mode(m, mu_out, mu_in):
            if m == 0:
                return level + slope * mu_out * mu_in
            return slope * np.sqrt((1 - mu_out**2) * (1 - mu_in**2)) / 2 if m == 1 else 0.0

        return Ground(brdf, mode)


class Vegetation(Surface):
    """Minnaert's law times a Henyey-Greenstein function of the phase angle.

    Both after H. Rahman, B. Pinty and M. M. Verstraete, J. Geophys. Res., 98, 20791-20801, 1993,
    doi:10.1029/93JD02072, equations 2-5, without their hot spot, whose kink no quadrature likes.
    """

    level: Float[Array, "*batch"]
    power: Float[Array, "*batch"]
    asymmetry: Float[Array, "*batch"]

    def brdf(self, mu_out, mu_in, relative_azimuth):
        sines = jnp.sqrt((1 - mu_out**2) * (1 - mu_in**2))
        cosine = mu_out * mu_in + sines * jnp.cos(relative_azimuth)
        g = self.asymmetry
        phase = (1 - g * g) / (1 + g * g + 2 * g * cosine) ** 1.5
        return self.level * (mu_out * mu_in * (mu_out + mu_in)) ** (self.power - 1) * phase

    def judged(self, i: int) -> Ground:
        level, power, g = (float(x[i]) for x in (self.level, self.power, self.asymmetry))

        def brdf(mu_out, mu_in, azimuth):
            sines = np.sqrt((1 - mu_out**2) * (1 - mu_in**2))
            cosine = mu_out * mu_in + sines * np.cos(azimuth)
            phase = (1 - g * g) * (1 + g * g + 2 * g * cosine) ** -1.5
            return level * (mu_out * mu_in * (mu_out + mu_in)) ** (power - 1) * phase

        def mode(m, mu_out, mu_in):
            azimuth = 2 * np.pi * np.arange(NUM_AZIMUTHS) / NUM_AZIMUTHS
            return float(np.mean(brdf(mu_out, mu_in, azimuth) * np.cos(m * azimuth)))

        return Ground(brdf, mode)


TILTED = Tilted(jnp.array([0.3, 0.1, 0.5]), jnp.array([0.2, 0.1, -0.3]))
VEGETATION = Vegetation(
    jnp.array([0.1, 0.05, 0.2]), jnp.array([0.8, 0.7, 1.0]), jnp.array([-0.2, -0.1, 0.3])
)


def columns():
    """Three columns with an empty layer, a transparent one and a thick one among their layers."""
    tau, ssa, moments, albedo, mu0, mu, azimuth = standard_columns(COUNT)
    tau[0, 1], ssa[1, 2], tau[2, 3], ssa[2, 3] = 0, 0, 30, 1
    return tau, ssa, moments, albedo, mu0, mu, azimuth


def views():
    """Four views of each column: nadir, the sun's own direction, a node, a grazing one."""
    mu0, mu = columns()[4:6]
    nodes, _ = half_range(NUM_STREAMS)
    many = np.stack([np.ones(COUNT), mu0, np.full(COUNT, nodes[1]), 0.1 * mu], axis=-1)
    return many, np.array([0.3, 0.0, np.pi, 2.0]) * np.ones((COUNT, 1))


def secants():
    """Of a low sun over a sphere: less than 1 / mu0, and less the higher the layer."""
    mu0 = columns()[4]
    return 1 / np.sqrt(mu0[:, None] ** 2 + np.array([0.04, 0.03, 0.02, 0.01, 0.0]))


def assert_right(ours, judged):
    np.testing.assert_allclose(ours, judged, rtol=RIGHT, atol=0)


def judged_grounds(ground):
    """One ground a column, as the judge takes them."""
    return [ground.judged(i) if isinstance(ground, Surface) else ground[i] for i in range(COUNT)]


def judge(arguments, ground, corrected, *, num_streams=NUM_STREAMS, **options):
    """Radiance of each column; options that are arrays have one entry a column."""
    tau, ssa, moments, _, mu0, mu, azimuth = arguments
    grounds = judged_grounds(ground)
    return np.array(
        [
            forty_digit_radiance(
                tau[i],
                ssa[i],
                moments[i],
                grounds[i],
                mu0[i],
                mu[i],
                azimuth[i],
                num_streams,
                corrected,
                **{k: x[i] if isinstance(x, np.ndarray) else x for k, x in options.items()},
            )
            for i in range(COUNT)
        ]
    )


def judge_brf(arguments, ground, corrected, **options):
    """Reflectance of each column."""
    mu0 = arguments[4].reshape(COUNT, *(1,) * (np.ndim(arguments[5]) - 1))
    return np.pi / mu0 * judge(arguments, ground, corrected, solar_irradiance=1.0, **options)


@pytest.mark.parametrize("level", [0.0, 0.3, 1.0])
def test_the_judge_knows_a_cavity(level):
    """In a warm cavity all radiances are those of a black body, whatever is scattered."""
    tau, ssa, moments, _, mu0, mu, azimuth = (x[0] for x in columns())
    glow = {"planck_levels": np.full(6, 2.0), "surface_emission": 2 * (1 - level)}
    radiance = forty_digit_radiance(
        tau, ssa, moments, level, mu0, mu, azimuth, 8, True, isotropic_top=2.0, **glow
    )
    # The emission, 2 (1 - level), is rounded to float64.
    np.testing.assert_allclose(radiance, 2, rtol=1e-15)


def test_the_judge_joins_deep_layers_as_it_does_thin_ones():
    """One layer, doubled within, and the thin ones that it is made of, joined from below."""
    parts, scattered = 64, np.array([1.0, 0.7, 0.4, 0.2, 0.1])
    levels = np.linspace(1.0, 3.0, parts + 1)  # whose steps are exact

    def radiance(number):
        each = 64.0 / number
        return forty_digit_radiance(
            *(np.full(number, each), np.full(number, 0.75), np.tile(scattered, (number, 1))),
            *(0.25, 0.5, 0.75, 0.0, NUM_STREAMS, False),
            planck_levels=levels[:: parts // number],
            surface_emission=2.0,
        )

    assert radiance(1) == radiance(parts)


def test_the_judge_knows_that_nothing_shines():
    column = np.array([3.0]), np.array([1.0]), np.array([[1.0, 0.5, 0.3, 0.1, 0.05]])
    warm = {"planck_levels": np.array([2.0, 2.0])}
    assert forty_digit_radiance(*column, 1.0, 0.5, 0.7, 0.0, NUM_STREAMS, False, **warm) == 0
    assert forty_digit_radiance(*column, 1.0, 0.5, 0.7, 0.0, NUM_STREAMS, False) == 0


def test_the_judge_knows_a_grey_ground():
    """Under absorbing air the reflectance is albedo times the transmission of both paths."""
    tau, _, moments, _, mu0, mu, azimuth = (x[0] for x in columns())
    result = forty_digit_brf(tau, 0 * tau, moments, 0.4, mu0, mu, azimuth, 8, True)
    np.testing.assert_allclose(result, 0.4 * np.exp(-tau.sum() * (1 / mu0 + 1 / mu)), rtol=1e-14)


@pytest.mark.parametrize(
    "ground, scattering, num_streams",
    [
        (TILTED, "tms", 4),
        pytest.param(VEGETATION, None, 4, marks=pytest.mark.slow),
        pytest.param(VEGETATION, "tms", 8, marks=pytest.mark.slow),
    ],
    ids=["tilted-TMS-4", "vegetation-4", "vegetation-TMS-8"],
)
def test_grounds_that_depend_on_direction(ground, scattering, num_streams):
    arguments = columns()
    ours = toa_brf(
        *arguments[:3],
        ground,
        *arguments[4:],
        num_streams=num_streams,
        single_scattering=scattering,
    )
    assert_right(ours, judge_brf(arguments, ground, scattering == "tms", num_streams=num_streams))


def test_a_constant_ground_is_lambertian():
    tau, ssa, moments, albedo, *angles = columns()
    options = {"num_streams": NUM_STREAMS}
    expected = toa_brf(tau, ssa, moments, albedo, *angles, **options)
    constant = Tilted(jnp.asarray(albedo), jnp.zeros(COUNT))
    for ground in (constant, Lambertian(jnp.asarray(albedo))):
        ours = toa_brf(tau, ssa, moments, ground, *angles, **options)
        np.testing.assert_allclose(ours, expected, rtol=ROUNDING)
    assert_right(expected, judge_brf(columns(), albedo, True))


@pytest.mark.parametrize(
    "ground, scattering, delta_m",
    [
        (None, "tms", False),
        pytest.param(None, None, False, marks=pytest.mark.slow),
        pytest.param(VEGETATION, "tms", True, marks=pytest.mark.slow),
    ],
    ids=["lambertian-TMS-unscaled", "lambertian-unscaled", "vegetation-TMS"],
)
def test_secants_of_the_beam(ground, scattering, delta_m):
    arguments = columns()
    ground = arguments[3] if ground is None else ground
    options = {"secant": secants(), "delta_m": delta_m}
    ours = toa_brf(
        *arguments[:3],
        ground,
        *arguments[4:],
        num_streams=NUM_STREAMS,
        single_scattering=scattering,
        **options,
    )
    assert_right(ours, judge_brf(arguments, ground, scattering == "tms", **options))


@pytest.mark.slow  # with secants and thermal light it is below
def test_several_views_in_one_call():
    arguments = (*columns()[:5], *views())
    ours = toa_brf(
        *arguments[:3], VEGETATION, *arguments[4:], num_streams=NUM_STREAMS, multiple_views=True
    )
    assert_right(ours, judge_brf(arguments, VEGETATION, True))


THERMAL = {
    "planck_levels": np.array(
        [[1.0, 2.0, 5.0, 3.0, 7.0, 4.0], [9.0, 8, 7, 6, 5, 4], [0.0, 0, 1, 0, 0, 2]]
    ),
    "surface_emission": np.array([4.0, 6.0, 0.0]),
    "isotropic_top": np.array([0.2, 0.0, 3.0]),
}


@pytest.mark.parametrize(
    "ground, delta_m",
    [(None, True), pytest.param(TILTED, False, marks=pytest.mark.slow)],
    ids=["lambertian", "tilted-unscaled"],
)
def test_thermal_light(ground, delta_m):
    """Levels, ground and sky shine, each alone and all together; the sun is below the horizon."""
    arguments = (*columns()[:5], *views())
    ground = arguments[3] if ground is None else ground
    alone = [{k: x * (k == name) for k, x in THERMAL.items()} for name in THERMAL]
    for sources in (*alone, THERMAL):
        ours = toa_radiance(
            *arguments[:3],
            ground,
            -arguments[4],
            *arguments[5:],
            solar_irradiance=0.0,
            num_streams=NUM_STREAMS,
            delta_m=delta_m,
            multiple_views=True,
            **sources,
        )
        assert_right(ours, judge(arguments, ground, True, delta_m=delta_m, **sources))


def test_sunlight_and_thermal_light_over_vegetation():
    arguments = (*columns()[:5], *views())
    options = {**THERMAL, "solar_irradiance": np.array([3.0, 20.0, 0.1]), "secant": secants()}
    ours = toa_radiance(
        *arguments[:3],
        VEGETATION,
        *arguments[4:],
        num_streams=NUM_STREAMS,
        multiple_views=True,
        **options,
    )
    assert_right(ours, judge(arguments, VEGETATION, True, **options))


@pytest.mark.parametrize("ground", [None, TILTED], ids=["lambertian", "tilted"])
def test_plane_albedo_is_the_reflectance_over_all_directions(ground):
    """At nodes and as many equal azimuths as streams, the sum over directions is exact."""
    num_streams = NUM_STREAMS
    nodes, weights = half_range(num_streams)
    azimuths = 2 * np.pi * np.arange(num_streams) / num_streams
    mu, azimuth = (x.ravel() for x in np.meshgrid(nodes, azimuths, indexing="ij"))
    tau, ssa, moments, albedo, mu0, *_ = columns()
    ground = albedo if ground is None else ground
    arguments = tau, ssa, moments, albedo, mu0, np.tile(mu, (COUNT, 1)), [azimuth] * COUNT
    brf = judge_brf(arguments, ground, False, num_streams=num_streams)
    expected = brf.reshape(COUNT, nodes.size, -1).mean(axis=-1) @ (2 * weights * nodes)
    ours = toa_albedo(tau, ssa, moments, ground, mu0, num_streams=num_streams)
    assert_right(ours, expected)


def test_surface_coupling_gives_every_albedo():
    """Under a slanting sun, too, as the reflectances of `toa_brf` (`test_albedo`)."""
    arguments = (*columns()[:5], *views())
    coupling = surface_coupling(
        *arguments[:3],
        *arguments[4:],
        num_streams=NUM_STREAMS,
        multiple_views=True,
        secant=secants(),
    )
    for albedo in (0.0, 0.4, 1.0):
        judged = judge_brf(arguments, np.full(COUNT, albedo), True, secant=secants())
        assert_right(coupling.brf(albedo), judged)
        # The ground is seen through 30 optical depths, which cost its albedo some digits.
        np.testing.assert_allclose(coupling.albedo(judged), albedo, atol=SEEN_THROUGH)
