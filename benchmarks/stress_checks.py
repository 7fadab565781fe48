"""What `stress.py` asks of a batch of columns: one error for each column and check.

An error is relative to the reflectance, or to `FLOOR` where that is less; of radiances the floor is
that share of the strongest source. One that does not apply to a column is NaN, and a result that is
not finite has an infinite error. `LIMITS` is what passes; `stress_report` says what each error
comes from.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from stress_columns import black_body, out_of_range
from stress_directions import along, moved, of_all, of_one

from abi_operator.solver import toa_albedo, toa_brf, toa_radiance

FLOOR = 1e-3
AGREE = 0.01  # of N and 2N streams, where signs are judged
ROUNDED = 8  # roundings; more between secant times mu0 and 1 is a sun through a sphere
BUDGET = 1e-3
BUDGET_FLOOR = 0.01  # as `Settings.error_budget` has it
MOST_STREAMS, DOUBLED_UP_TO = 64, 16
LOOKED_AT = 64  # columns together, of those that are solved with other streams too
JIT_UP_TO = 16  # streams: compiling more of them twice takes longer than all the rest
# Step of the difference quotient, of each argument's own scale; of single precision too, since the
# quotient is always that of double precision.
STEP = 1e-5
# Single precision is right for so much conservative scattering, by which is meant this co-albedo
# (README, Limits); columns with more are counted, and not judged. Nor are slopes of so much more,
# which are sums of terms as many times as large (`method.rounding`).
CONSERVATIVE, MOST_CONSERVATIVE, MOST_OF_SLOPES = 1e-5, 1e5, 1e3
OF_SLOPES = ("jvp and vjp", "slopes inside jit", "float32 slope", "float32 partial")

CHECKS = {
    "finite value": "a value that is not finite",
    "finite slopes": "a derivative, in any argument, that is not finite",
    "not negative": "depth below 0 of a reflectance over black ground, N and 2N streams agreeing",
    "rising in albedo": "fall of it from black to grey or from grey to white ground, likewise",
    "energy": "plane albedo less 1 of the column made conservative over white ground; radiance of "
    "the column in an enclosure of one temperature less the black body's",
    "absorption": "plane albedo outside [0, 1]",
    "reciprocity": "sun and view exchanged, both through a plane",
    "jvp and vjp": "forward and reverse mode, which share one gradient, of its terms' sizes",
    "slope": "reverse mode along all arguments at once and a difference quotient, of the same",
    "partial": "slope in one number of one argument, and a quotient of steps inward, of itself "
    f"or of {FLOOR:g} of the reflectance",
    "inside jit": "value inside jax.jit and outside",
    "slopes inside jit": "slope along one direction inside jax.jit and outside",
    "budget": f"error budget of {BUDGET:g} and none",
    "float32": "single and double precision, of the same numbers in single precision",
    "float32 slope": "slope along all arguments at once, likewise, of the sum of its terms' sizes",
    "float32 partial": "slope in one number of one argument, likewise, of the same",
}
# What passes, in double and in single precision, in which a stack's light is a difference of
# numbers as many times as large as the layers that do not absorb are deep (`method.rounding`): 1e3
# of them, at 6e-8, are 6e-5 of a number of order 1, and a hundred times that where it is small.
LIMITS = {
    "finite value": (0.0, 0.0),
    "finite slopes": (0.0, 0.0),
    "not negative": (1e-12, 1e-3),
    "rising in albedo": (1e-10, 1e-3),
    "energy": (1e-8, 1e-2),
    "absorption": (1e-10, 1e-3),
    "reciprocity": (1e-8, 1e-2),
    "jvp and vjp": (1e-10, 1e-4),
    "slope": (1e-2, np.inf),
    "partial": (1e-2, np.inf),
    "inside jit": (1e-6, 2e-2),
    "slopes inside jit": (1e-6, 2e-2),
    "budget": (10 * BUDGET, 10 * BUDGET),
    "float32": (np.inf, 2e-2),
    "float32 slope": (np.inf, 0.3),
    "float32 partial": (np.inf, 0.1),
}


def solved(columns, **how):
    """Reflectance, or radiance where there are sources."""
    door = toa_radiance if "planck_levels" in columns else toa_brf
    return door(**columns, **how)


def value(columns, **how):
    return np.asarray(solved(columns, **how), np.float64)


def scale_of(size, light, floor):
    """What errors of slopes in one number are relative to.

    Where sun and view graze a reflectance may be 1e9, of which a quotient over a step of `STEP` has
    rounding of a tenth: slopes are not asked for more than `FLOOR` of the reflectance.
    """
    return np.maximum(size, np.maximum(floor, FLOOR * abs(light)))


def total(columns, num_streams):
    found = solved(columns, num_streams=num_streams)
    return jnp.sum(found), found


both = jax.value_and_grad(total, has_aux=True)
both_inside_jit = jax.jit(both, static_argnums=1)


class Judged:
    """Errors of one batch by check; see `CHECKS`.

    Parameters
    ----------
    columns
        Arguments of the solver, all of one precision.
    further
        The moments again, as many as twice the streams need.
    num_streams
        How many streams.
    key
        Integers that choose the directions along which slopes are compared.
    """

    def __init__(self, columns, further, num_streams, key):
        self.columns, self.further, self.streams = columns, further, num_streams
        self.emitting = "planck_levels" in columns
        self.single = columns["tau"].dtype == np.float32
        self.count = columns["mu"].size
        self.errors = {name: np.full(self.count, np.nan) for name in CHECKS}
        self.directions, self.one = of_all(columns, key), of_one(columns, key)
        self.floor = np.full(self.count, FLOOR)
        if self.emitting:
            sun = columns["solar_irradiance"] * columns["mu0"] / np.pi
            strongest = [columns["planck_levels"].max(axis=1), columns["surface_emission"]]
            strongest += [columns["isotropic_top"], sun]
            self.floor = FLOOR * np.max(strongest, axis=0).astype(np.float64)

    def all(self):
        self.value = value(self.columns, num_streams=self.streams)
        self._errors("finite value", np.where(np.isfinite(self.value), 0, np.inf))
        self._derivatives()
        self._of_sources() if self.emitting else self._of_sunlight()
        how = {"num_streams": self.streams}
        if self.streams < MOST_STREAMS:
            found = value(self.columns, **how, error_budget=BUDGET)
            scale = np.maximum(abs(self.value), self.floor * BUDGET_FLOOR / FLOOR)
            self._errors("budget", abs(found - self.value) / scale)
        if self.single:
            double = {name: x.astype(np.float64) for name, x in self.columns.items()}
            exact = value(double, **how)
            self._errors("float32", self._apart(self.value, exact))
            beyond = self.beyond(self.columns["ssa"])
            for found in self.errors.values():
                found[beyond] = np.nan
            for name in OF_SLOPES:
                self.errors[name][self.beyond(self.columns["ssa"], MOST_OF_SLOPES)] = np.nan
            if not self.emitting:
                self.errors["energy"][self.beyond(np.ones_like(self.columns["ssa"]))] = np.nan
        return self.errors

    def beyond(self, ssa, most=MOST_CONSERVATIVE):
        """Columns with more conservative scattering than single precision is for."""
        tau = np.where(1 - ssa < CONSERVATIVE, self.columns["tau"], 0).sum(axis=1)
        return self.single & (tau > most)

    def _errors(self, name, found):
        self.errors[name] = np.where(np.isnan(found), np.inf, found)

    def _apart(self, found, right):
        return abs(found - right) / np.maximum(abs(right), self.floor)

    def _derivatives(self):
        columns, directions = self.columns, self.directions
        (_, found), slopes = both(columns, self.streams)
        finite = np.isfinite(np.asarray(found))
        for slope in slopes.values():
            finite &= np.isfinite(np.reshape(slope, (self.count, -1))).all(axis=1)
        self._errors("finite slopes", np.where(finite, 0, np.inf))
        reverse, sizes = along(slopes, directions)
        solve = partial(solved, num_streams=self.streams)
        _, forward = jax.jvp(solve, (columns,), (directions,))
        scale = np.maximum(sizes, self.floor)
        self._errors("jvp and vjp", abs(np.asarray(forward, float) - reverse) / scale)
        double = {name: x.astype(np.float64) for name, x in columns.items()}
        if not self.single:
            ahead, behind = (
                value(moved(double, directions, way * STEP), num_streams=self.streams)
                for way in (1, -1)
            )
            quotient = (ahead - behind) / (2 * STEP)
            self._errors("slope", abs(quotient - reverse) / scale)
            partial_slope, size = along(slopes, self.one)
            once, twice = (
                value(moved(double, self.one, step * STEP), num_streams=self.streams)
                for step in (1, 2)
            )
            quotient = (4 * once - twice - 3 * self.value) / (2 * STEP)
            of = scale_of(size, self.value, self.floor)
            self._errors("partial", abs(quotient - partial_slope) / of)
        else:
            _, exact = both(double, self.streams)
            wide = {name: x.astype(np.float64) for name, x in directions.items()}
            right, sizes = along(exact, wide)
            self._errors("float32 slope", abs(reverse - right) / np.maximum(sizes, self.floor))
            right, size = along(exact, self.one)
            found = along(slopes, self.one)[0]
            of = scale_of(size, self.value, self.floor)
            self._errors("float32 partial", abs(found - right) / of)
        if self.streams <= JIT_UP_TO:
            (_, inside), slopes = both_inside_jit(columns, self.streams)
            self._errors("inside jit", self._apart(np.asarray(inside, float), self.value))
            apart = abs(along(slopes, directions)[0] - reverse)
            self._errors("slopes inside jit", apart / scale)

    def _of_sunlight(self):
        columns, how = self.columns, {"num_streams": self.streams}
        exchanged = {"mu0": columns["mu"], "mu": columns["mu0"]}
        exchanged["secant"] = np.broadcast_to(1 / columns["mu"][:, None], columns["tau"].shape)
        self._errors("reciprocity", self._apart(value(columns | exchanged, **how), self.value))
        rounded = ROUNDED * np.finfo(columns["mu0"].dtype).eps
        bent = abs(columns["secant"] * columns["mu0"][:, None] - 1) > rounded
        self.errors["reciprocity"][bent.any(axis=1)] = np.nan
        ground = columns["albedo"]
        black, white = (value(columns | {"albedo": np.full_like(ground, x)}, **how) for x in (0, 1))
        size = np.maximum(abs(self.value), self.floor)
        below = np.maximum(-black, 0) / size
        fall = np.maximum(np.maximum(black - self.value, self.value - white), 0) / size
        self._where_streams_agree({"not negative": below, "rising in albedo": fall}, (0, None, 1))
        lit = {name: columns[name] for name in ("tau", "ssa", "moments", "albedo", "mu0")}
        share = np.asarray(toa_albedo(**lit, **how), float)
        self._errors("absorption", np.maximum(np.maximum(-share, share - 1), 0))
        whole = lit | {"ssa": np.ones_like(lit["ssa"]), "albedo": np.ones_like(ground)}
        self._errors("energy", abs(np.asarray(toa_albedo(**whole, **how), float) - 1))

    def _where_streams_agree(self, errors, grounds):
        """Errors, but not of columns in which twice the streams give something else.

        Half of them where twice are slow to compile; over ground of these albedos, None for its
        own; in double precision. Columns that pass are not looked at.
        """
        limits = {name: LIMITS[name][self.single] for name in errors}
        wrong = np.any([errors[name] > limits[name] for name in errors], axis=0)
        rows, agree = np.flatnonzero(wrong), np.ones(self.count, bool)
        more = 2 * self.streams if self.streams <= DOUBLED_UP_TO else self.streams // 2
        for start in range(0, rows.size, LOOKED_AT):
            own = rows[start : start + LOOKED_AT]
            some = np.resize(own, LOOKED_AT)
            part = {name: x[some].astype(np.float64) for name, x in self.columns.items()}
            wider = part | {"moments": self.further[some, :, : more + 1].astype(np.float64)}
            for ground in grounds:
                over = {} if ground is None else {"albedo": np.full(LOOKED_AT, float(ground))}
                here = value(part | over, num_streams=self.streams)
                there = value(wider | over, num_streams=more)
                # What is not a number agrees, and fails.
                agree[own] &= ~(abs(here - there) > AGREE * abs(there))[: own.size]
        for name, found in errors.items():
            self._errors(name, found)
            self.errors[name][~agree] = np.nan

    def _of_sources(self):
        """Nothing can be brighter or darker than black in an enclosure of one temperature."""
        below = np.maximum(-self.value, 0) / self.floor
        self._where_streams_agree({"not negative": below}, (None,))
        columns = self.columns
        one = np.full_like(columns["albedo"], black_body(300.0))
        enclosed = columns | {
            "solar_irradiance": np.zeros_like(one),
            "planck_levels": np.full_like(columns["planck_levels"], one[0]),
            "surface_emission": (1 - columns["albedo"]) * one,
            "isotropic_top": one,
        }
        found = value(enclosed, num_streams=self.streams)
        self._errors("energy", abs(found / one - 1))


def refused(columns, num_streams):
    """Of each argument how often numbers that are not allowed came, and how often it was named."""
    found = {}
    for name, _, wrong in out_of_range(columns):
        offered, named = found.get(name, (0, 0))
        try:
            solved(wrong, num_streams=num_streams)
        except ValueError as error:
            named += str(error).startswith(name)
        found[name] = offered + 1, named
    return found
