"""Gas absorption: published transmittances, the paper's case 1, additivity, doors, derivatives."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.bands import BANDS, Band
from abi_operator.optics.gas import ALL_GASES, gas_absorption, transmittance
from abi_operator.optics.gas.amounts import WarmVapour, gases_of, self_continuum_vapour
from abi_operator.optics.gas.tables import TABLES
from abi_operator.standard_atmospheres import standard_atmosphere

PROFILES = ("tropical", "midlatitude_summer", "midlatitude_winter", "us_standard")
DISTINCT = ("C02", "C04", "C06", "C07")  # between them every kind of amount
AIR_MASSES = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0])
OBLIQUE = np.array([8.0, 10.0, 12.0])  # there and back at 80 degrees

# Transmittance of single gases over the response of GOES-16, 6SV2.1 (Vermote et al. 1997,
# Kotchenova et al. 2006), as T = exp(-a m U) for ozone, U in atm-cm; exp(-exp(a + b x + c x^2)),
# x = ln mU, for vapour, U in cm; exp(-a m^b P^c X^d) for mixed gases.
OZONE = {"C01": 0.01032, "green": 0.08855, "C02": 0.07898}
VAPOUR = {
    "C02": (-6.0463, 0.9946, -0.0475),
    "C03": (-6.6852, 1.0010, -0.0347),
    "C05": (-7.6888, 1.0459, -0.0194),
}
MIXED = {
    "C02": {"O2": (0.001016, 0.604, 1.001, 0.0)},
    "C05": {"CO2": (0.02062, 0.696, 1.001, 0.684), "CH4": (0.001201, 0.916, 1.120, 0.908)},
    "C06": {"CH4": (0.03786, 0.818, 1.042, 0.804), "N2O": (0.002784, 0.897, 0.958, 0.885)},
}
# Gases of a band that are elsewhere compared.
LINE_BY_LINE = {"C06": ("H2O",)}
# Largest error of the sums, with all gases or one, for air masses to 6 and to 12.
SUM_ERROR = {"C01": 1e-6, "green": 1e-6, "C02": 0.0038, "C03": 0.0013, "C05": 7e-4, "C06": 0.0029}
OBLIQUE_ERROR = SUM_ERROR | {"C02": 0.022, "C03": 0.009, "C06": 0.0034}


def published_depth(band, gas, air_mass, atmosphere):
    """Depth of one gas on a path to the ground by the closed forms; 0 where it has none."""
    gases = gases_of(atmosphere)
    relative = np.asarray(atmosphere.pressure)[-1] / 101325
    if gas == "O3":
        return OZONE.get(band, 0.0) * air_mass * 1e-3 * np.sum(gases.ozone)
    if gas == "H2O" and band in VAPOUR:
        vapour = 0.1 * np.sum(gases.vapour)
        x = np.log(air_mass * vapour)
        a, b, c = VAPOUR[band]
        return np.exp(a + b * x + c * x**2)
    if gas in MIXED.get(band, {}):
        a, b, c, d = MIXED[band][gas]
        mixing = {
            "O2": 1.0,
            "CO2": gases.carbon_dioxide / 400e-6,
            "CH4": gases.methane / 1.85e-6,
            "N2O": gases.nitrous_oxide / 0.33e-6,
        }[gas]
        return a * air_mass**b * relative**c * float(mixing) ** d
    return 0.0 * air_mass


@pytest.mark.parametrize("band", SUM_ERROR)
@pytest.mark.parametrize("name", ["tropical", "midlatitude_winter"])  # most vapour, and least
def test_sums_have_the_published_transmittance(band, name):
    """Each gas alone and all together, from the ground and from 2 km, one and two ways."""
    for ground, mixing in ((0.0, 1.1), (2000.0, 0.9)):
        atmosphere = standard_atmosphere(
            name,
            np.linspace(80e3, ground, 41),
            carbon_dioxide=mixing * 400e-6,
            methane=mixing * 1.85e-6,
            nitrous_oxide=mixing * 0.33e-6,
        )
        every = tuple(gas for gas in ALL_GASES if gas not in LINE_BY_LINE.get(band, ()))
        for gases in (every, *((gas,) for gas in every)):
            optics = gas_absorption(atmosphere, BANDS[band], gases)
            air_mass = np.concatenate([AIR_MASSES, OBLIQUE])
            got = np.asarray(transmittance(optics, jnp.asarray(air_mass)))
            depth = sum(published_depth(band, g, air_mass, atmosphere) for g in gases)
            error, count = np.abs(got - np.exp(-depth)), len(AIR_MASSES)
            assert error[:count].max() <= SUM_ERROR[band]
            assert error[count:].max() <= OBLIQUE_ERROR[band]


# Two-way transmittances of the first case of Grasso et al. (2013) from 75 degrees west, 1 cm of
# precipitable water, 0.28 atm-cm of ozone, air mass 3.48: 6SV2.1 by the closed forms; in C06 vapour
# line by line, with the continuum of MT_CKD 4.3.
CASE_1 = {"C01": 0.990, "green": 0.917, "C02": 0.917, "C03": 0.996, "C05": 0.947, "C06": 0.870}
LAST_DIGIT = 5e-4


@pytest.mark.parametrize("band", CASE_1)
def test_first_case_of_grasso(band):
    atmosphere = standard_atmosphere("us_standard", precipitable_water=10.0, ozone_column=280.0)
    got = transmittance(gas_absorption(atmosphere, BANDS[band]), jnp.asarray(3.48))
    np.testing.assert_allclose(got, CASE_1[band], atol=LAST_DIGIT + SUM_ERROR[band], rtol=0)


# One-way vertical transmittance of C04 from levels to space in the US standard atmosphere,
# LOWTRAN7 (Kneizys et al., AFGL-TR-88-0177, 1988), from independent line and continuum data.
LOWTRAN_C04 = {0: 0.0031, 2: 0.0562, 4: 0.2643, 5: 0.4123, 6: 0.5612, 8: 0.8073, 10: 0.9331}
LINE_DATA = 0.017  # between the two parent models, sum included


def test_vapour_in_c04_against_lowtran():
    for height_km, expected in LOWTRAN_C04.items():
        atmosphere = standard_atmosphere("us_standard", np.linspace(50e3, 1e3 * height_km, 41))
        got = transmittance(gas_absorption(atmosphere, BANDS["C04"]), jnp.asarray(1.0))
        np.testing.assert_allclose(got, expected, atol=LINE_DATA, rtol=0)


# One-way transmittance of C07 from levels to space with 330, 1.7 and 0.33 ppm of CO2, CH4 and N2O,
# air mass 1, 2 and 4: all gases; vapour alone; N2O alone. Lines of HITRAN and an estimate of HDO,
# the continuum of MT_CKD 4.3, and LOWTRAN7 for CO2, CH4 and N2, over the response of GOES-16 and
# the emission of 300 K (`benchmarks/fit_gas_c07.py`).
LINES_C07 = {
    ("tropical", 0): ((0.8138, 0.6964, 0.5360), (0.9196, 0.8648, 0.7834), (0.9412, 0.9009, 0.8426)),
    ("tropical", 2): ((0.8876, 0.8104, 0.6956), (0.9717, 0.9495, 0.9143), (0.9530, 0.9206, 0.8731)),
    ("tropical", 5): ((0.9396, 0.8975, 0.8313), (0.9954, 0.9912, 0.9835), (0.9671, 0.9442, 0.9105)),
    ("tropical", 12): (
        (0.9811, 0.9683, 0.9485),
        (1.0000, 1.0000, 1.0000),
        (0.9872, 0.9782, 0.9649),
    ),
    ("midlatitude_summer", 0): (
        (0.8347, 0.7269, 0.5759),
        (0.9426, 0.9015, 0.8394),
        (0.9411, 0.9009, 0.8425),
    ),
    ("midlatitude_summer", 2): (
        (0.8959, 0.8236, 0.7147),
        (0.9799, 0.9634, 0.9367),
        (0.9531, 0.9208, 0.8734),
    ),
    ("midlatitude_summer", 5): (
        (0.9416, 0.9009, 0.8369),
        (0.9966, 0.9934, 0.9875),
        (0.9674, 0.9447, 0.9111),
    ),
    ("midlatitude_summer", 12): (
        (0.9816, 0.9692, 0.9500),
        (1.0000, 1.0000, 1.0000),
        (0.9874, 0.9786, 0.9655),
    ),
    ("midlatitude_winter", 0): (
        (0.8713, 0.7830, 0.6519),
        (0.9837, 0.9697, 0.9463),
        (0.9408, 0.9005, 0.8424),
    ),
    ("midlatitude_winter", 2): (
        (0.9102, 0.8477, 0.7513),
        (0.9936, 0.9877, 0.9772),
        (0.9538, 0.9220, 0.8755),
    ),
    ("midlatitude_winter", 5): (
        (0.9467, 0.9098, 0.8520),
        (0.9991, 0.9982, 0.9965),
        (0.9686, 0.9469, 0.9147),
    ),
    ("midlatitude_winter", 12): (
        (0.9836, 0.9725, 0.9555),
        (1.0000, 1.0000, 1.0000),
        (0.9887, 0.9808, 0.9690),
    ),
    ("us_standard", 0): (
        (0.8617, 0.7677, 0.6308),
        (0.9725, 0.9505, 0.9155),
        (0.9411, 0.9009, 0.8429),
    ),
    ("us_standard", 2): (
        (0.9053, 0.8393, 0.7382),
        (0.9893, 0.9798, 0.9636),
        (0.9535, 0.9214, 0.8747),
    ),
    ("us_standard", 5): (
        (0.9444, 0.9059, 0.8454),
        (0.9981, 0.9963, 0.9929),
        (0.9681, 0.9460, 0.9132),
    ),
    ("us_standard", 12): (
        (0.9829, 0.9713, 0.9535),
        (1.0000, 1.0000, 1.0000),
        (0.9883, 0.9802, 0.9680),
    ),
}
C07_ERROR = {ALL_GASES: 0.0050, ("H2O",): 0.0045, ("N2O",): 0.0065}  # layers are 1.5 km thick


def test_c07_against_lines():
    air_mass = jnp.asarray([1.0, 2.0, 4.0])
    for (name, height_km), expected in LINES_C07.items():
        height = np.linspace(60e3, 1e3 * height_km, 41)
        atmosphere = standard_atmosphere(name, height, carbon_dioxide=330e-6, methane=1.7e-6)
        for (gases, error), values in zip(C07_ERROR.items(), expected, strict=True):
            got = transmittance(gas_absorption(atmosphere, BANDS["C07"], gases), air_mass)
            np.testing.assert_allclose(got, values, atol=error, rtol=0)


# Transmittance of vapour in C06 from levels to space, air mass 1, 2 and 4, by lines of HITRAN and
# the continuum of MT_CKD 4.3 over the response of GOES-16 (`benchmarks/fit_gas_c06.py`).
LINES_C06 = {
    ("tropical", 0): (0.9547, 0.9148, 0.8434),
    ("tropical", 2): (0.9880, 0.9771, 0.9567),
    ("midlatitude_summer", 0): (0.9706, 0.9442, 0.8961),
    ("midlatitude_winter", 0): (0.9934, 0.9871, 0.9751),
    ("us_standard", 0): (0.9882, 0.9772, 0.9568),
    ("us_standard", 2): (0.9962, 0.9926, 0.9856),
}
C06_ERROR = 0.0040  # layers are 1.5 km thick


def test_vapour_in_c06_against_lines():
    for (name, height_km), expected in LINES_C06.items():
        atmosphere = standard_atmosphere(name, np.linspace(60e3, 1e3 * height_km, 41))
        optics = gas_absorption(atmosphere, BANDS["C06"], ("H2O",))
        got = transmittance(optics, jnp.asarray([1.0, 2.0, 4.0]))
        np.testing.assert_allclose(got, expected, atol=C06_ERROR, rtol=0)


def test_no_temperature_makes_vapour_absorb_less_than_nothing():
    """From cold to flames; from 150 to 325 K the parabola, with its slope at the ends."""
    warmth = np.array([1.0, 80.0, 150.0, 220.0, 300.0, 325.0, 450.0, 800.0, 5e3])
    parabolas = [
        absorber.amount
        for band in ("C04", "C07")
        for absorber in TABLES[band].absorbers
        if isinstance(absorber.amount, WarmVapour)
    ]
    assert len(parabolas) == 2

    def factors(temperature):
        levels = jnp.repeat(temperature, 2)  # of which every other layer is as warm as both
        air = eqx.tree_at(
            lambda a: (a.pressure, a.temperature),
            standard_atmosphere("us_standard", np.linspace(30e3, 0.0, levels.size)),
            (jnp.linspace(0.0, 1e5, levels.size), levels),
        )
        path = jnp.ones(levels.size - 1)
        return jnp.stack([amount.of_path(air, path)[::2] for amount in parabolas])

    found, slopes = jax.jvp(factors, (jnp.asarray(warmth),), (jnp.ones(warmth.size),))
    assert np.all(found > 0.05) and np.all(np.isfinite(slopes))
    x, known = warmth / 250 - 1, slice(2, 6)
    for amount, values, tangents in zip(parabolas, found, slopes, strict=True):
        expected = 1 + amount.linear * x + amount.quadratic * x**2
        np.testing.assert_allclose(values[known], expected[known], rtol=1e-14)
        expected = (amount.linear + 2 * amount.quadratic * x) / 250
        np.testing.assert_allclose(tangents[known], expected[known], rtol=1e-12)
    beyond = np.array([150.0, 325.0])
    (low, below), (high, above) = (
        jax.jvp(factors, (jnp.asarray(beyond + np.array([-s, s])),), (jnp.ones(2),))
        for s in (1e-7, -1e-7)
    )
    np.testing.assert_allclose(low, high, rtol=1e-8)
    np.testing.assert_allclose(below, above, rtol=1e-7)


def test_terms():
    """The terms of each band, and one where the chosen gases are grey."""
    atmosphere = standard_atmosphere("us_standard")
    terms = {b: gas_absorption(atmosphere, BANDS[b]).weight.shape[0] for b in BANDS}
    grey = {"C01": 1, "green": 1, "C02": 1, "C03": 1}
    assert grey.items() <= terms.items()
    for name, table in TABLES.items():
        assert terms[name] == len(table.weight)
        np.testing.assert_allclose(sum(table.weight), 1, atol=1e-12)
        assert all(len(a.coefficients) == terms[name] for a in table.absorbers)
        assert all(k >= 0 for a in table.absorbers for k in a.coefficients)
    for chosen in ((), ("O3",), ("O2", "O3")):
        assert gas_absorption(atmosphere, BANDS["C06"], chosen).weight.shape == (1,)


@pytest.mark.parametrize("band", BANDS)
def test_without_gases_nothing_absorbs(band, make_atmosphere):
    for optics in (
        gas_absorption(make_atmosphere(), BANDS[band]),
        gas_absorption(standard_atmosphere("tropical"), BANDS[band], ()),
    ):
        assert optics.extinction.shape[0] == 1 and optics.scatterers == ()
        np.testing.assert_array_equal(optics.extinction, 0)
        np.testing.assert_array_equal(optics.weight, [1])


# Vapour that is scaled by the mean pressure and temperature of a layer depends on its thickness.
THICK_LAYERS = {"C04": 0.01, "C06": 4e-4, "C07": 2e-3}


@pytest.mark.parametrize("band", BANDS)
def test_layers_add(band):
    """The transmittance to the ground does not depend on the levels."""
    coarse, fine = (
        transmittance(
            gas_absorption(
                standard_atmosphere("midlatitude_summer", np.linspace(40e3, 0, n)), BANDS[band]
            ),
            jnp.asarray([1.0, 3.0]),
        )
        for n in (41, 161)
    )
    np.testing.assert_allclose(coarse, fine, atol=THICK_LAYERS.get(band, 1e-12), rtol=0)


@pytest.mark.parametrize("band", ["C04", "C06"])  # nearly every kind of amount
def test_derivatives(band):
    """Forward against differences and backward against forward; finite where a gas is absent."""

    def log_transmittance(atmosphere):
        optics = gas_absorption(atmosphere, BANDS[band])
        return jnp.log(transmittance(optics, jnp.asarray(2.5)))

    forward_of = jax.jit(lambda a, tangent: jax.jvp(log_transmittance, (a,), (tangent,)))
    backward_of = jax.jit(jax.grad(log_transmittance))

    height = np.linspace(60e3, 0, 9)
    atmosphere = standard_atmosphere("midlatitude_summer", height)
    atmosphere = eqx.tree_at(lambda a: a.pressure, atmosphere, atmosphere.pressure.at[0].set(0.0))
    rng = np.random.default_rng(5)
    direction = jax.tree.map(lambda x: x * rng.uniform(-1, 1, x.shape), atmosphere)
    step = 1e-5
    up, down = (
        jax.tree.map(lambda x, d, s=s: x + s * d, atmosphere, direction) for s in (step, -step)
    )
    forward = forward_of(atmosphere, direction)[1]
    ahead, behind = (forward_of(a, direction)[0] for a in (up, down))
    np.testing.assert_allclose(forward, (ahead - behind) / (2 * step), rtol=1e-7)
    backward = backward_of(atmosphere)
    along = sum(
        jnp.vdot(g, d)
        for g, d in zip(jax.tree.leaves(backward), jax.tree.leaves(direction), strict=True)
    )
    np.testing.assert_allclose(along, forward, rtol=1e-12)
    none = eqx.tree_at(
        lambda a: a.gases, atmosphere, jax.tree.map(jnp.zeros_like, atmosphere.gases)
    )
    for leaf in jax.tree.leaves(backward_of(none)):
        assert np.all(np.isfinite(leaf))


@pytest.mark.parametrize("band", ["C06"])
def test_batch_is_a_loop(band):
    height = np.linspace(40e3, 0, 41)
    columns = [standard_atmosphere(name, height) for name in PROFILES]
    batch = jax.tree.map(lambda *leaves: jnp.stack(leaves), *columns)
    together = jax.jit(jax.vmap(lambda a: gas_absorption(a, BANDS[band]).extinction))(batch)
    for column, extinction in zip(columns, together, strict=True):
        one = gas_absorption(column, BANDS[band]).extinction
        np.testing.assert_allclose(one, extinction, rtol=1e-13)


def test_doors(make_atmosphere):
    atmosphere = standard_atmosphere("us_standard")
    with pytest.raises(ValueError, match="no gas absorption for band 'C13'; have"):
        gas_absorption(atmosphere, Band("C13", 10.34))
    with pytest.raises(ValueError, match=r"gases \['SO2'\] are not known; choose from"):
        gas_absorption(atmosphere, BANDS["C05"], ("H2O", "SO2"))
    cold = eqx.tree_at(lambda a: a.temperature, atmosphere, None)
    with pytest.raises(ValueError, match="needs atmosphere.temperature"):
        gas_absorption(cold, BANDS["C04"])


@pytest.mark.float32
@pytest.mark.parametrize("band", DISTINCT)
def test_float32_stays(band):
    atmosphere = jax.tree.map(
        lambda x: x.astype(jnp.float32), standard_atmosphere("tropical", np.linspace(40e3, 0, 41))
    )
    optics = gas_absorption(atmosphere, BANDS[band])
    assert optics.extinction.dtype == optics.weight.dtype == jnp.float32
    assert transmittance(optics, jnp.asarray(2.0, jnp.float32)).dtype == jnp.float32


def test_a_layer_of_next_to_no_air_has_finite_slopes():
    """Of a difference of pressure whose square is no number of the type."""
    for dtype, sliver in ((np.float64, 1e-200), (np.float32, 1e-25)):
        air = standard_atmosphere("us_standard", np.array([0.0, 1e3, 2e3])[::-1])
        air = jax.tree.map(lambda x, dtype=dtype: jnp.asarray(x, dtype), air)
        pressure = jnp.asarray([0.0, sliver, 1e5], dtype)
        slopes = jax.jacrev(
            lambda p, air=air: self_continuum_vapour(eqx.tree_at(lambda a: a.pressure, air, p))
        )(pressure)
        assert np.isfinite(slopes).all()


@pytest.mark.parametrize("inside", [jax.jit, lambda x: x], ids=["jit", "plain"])
def test_levels_at_one_pressure_have_nothing_between_them(inside):
    """Under much methane, where a joined product and difference had -2e-11; with the slope of a
    layer that opens downwards."""
    air = standard_atmosphere("us_standard")
    air = eqx.tree_at(lambda a: a.gases.methane, air, jnp.ones_like(air.gases.methane))
    pressures = jnp.asarray(air.pressure).at[-1].set(air.pressure[-2])
    columns = jnp.stack([jnp.zeros_like(pressures), pressures, pressures])

    def lowest(pressure):
        given = eqx.tree_at(lambda a: a.pressure, air, pressure)
        return gas_absorption(given, BANDS["C06"], ("CH4", "CO2")).extinction[:, -1]

    tau = np.asarray(inside(jax.vmap(lowest))(columns))
    np.testing.assert_array_equal(tau, 0)
    downwards = jnp.zeros_like(pressures).at[-1].set(1.0)
    _, slope = jax.jvp(lowest, (pressures,), (downwards,))
    assert (np.asarray(slope) > 0).all()
