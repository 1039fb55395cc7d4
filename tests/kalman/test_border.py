"""The border of the core: what carries more than numbers is converted with its meaning, or refused, everywhere."""

import datetime
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from scipy import sparse

from geokalman.kalman import (
    Adaptive, Gaussian, Information, Innovation, Manifold, Model, Sensor, chi_square_bounds, extended, gauss_markov,
    gaussian, integrated_white_noise, linear, nees, nis, run, smooth, smooth_information, smooth_two_filter,
    unscented, van_loan, whiteness,
)  # fmt: skip
from geokalman.kalman.checks import plain, scalar
from geokalman.kalman.robust import gate, redundancy_numbers
from geokalman.kalman.whitening import whiten_columns
from geokalman.leastsquares import NormalEquations

MA = np.ma.masked_array


class Quantity(np.ndarray):
    """As astropy has it: an array with a unit."""

    def __new__(cls, values, unit):
        out = np.asarray(values, dtype=float).view(cls)
        out.unit = unit
        return out

    def __array_finalize__(self, other):
        self.unit = getattr(other, "unit", None)


class Measured:
    """As pint and xarray have it: no array, but the way to one."""

    def __init__(self, values, units):
        self.values, self.units = np.asarray(values), units

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self.values, dtype=dtype)


class Masked:
    """As astropy's Masked: a mask of its own."""

    def __init__(self, values, mask):
        self.values, self.mask = np.asarray(values), np.asarray(mask)

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self.values, dtype=dtype)


class Time:
    """As astropy's Time."""

    jd1, jd2 = 2456658.5, 0.0


class TimeDelta:
    """As astropy's TimeDelta."""

    jd1, jd2 = 0.0, 0.5


class UnitFloat(float):
    """As units on single numbers may come."""

    unit = "km"


class NoUnit(Measured):
    """Where one of the two names of a unit is there and empty."""

    unit = None


class Elsewhere:
    """As an array on another device."""

    def __array__(self, dtype=None, copy=None):
        raise TypeError("on another device")


DAY = datetime.datetime(2013, 5, 7)


@pytest.mark.parametrize(
    ("value", "says"),
    [
        (np.array(["2013-05-07", "2013-05-08"], "datetime64[D]"), "holds dates: give seconds as float"),
        (np.array([1, 2], "timedelta64[s]"), "holds time spans: give seconds as float"),
        (np.datetime64("2013-05-07"), "dates"),
        ([DAY, DAY + datetime.timedelta(1)], "dates"),
        ([datetime.timedelta(1)], "time spans"),
        (np.array([DAY, DAY]), "dates"),
        (Time(), "dates"),
        ([np.datetime64("NaT", "s")], "dates"),
        (Quantity([1.0, 2.0], "km"), "carries the unit km: give plain numbers"),
        ([Quantity([1.0], "km"), Quantity([2.0], "km")], "carries the unit km"),
        (Measured([1.0, 2.0], "metre"), "carries the unit metre"),
        (np.array([1.0 + 0.0j]), "holds complex numbers"),
        ([1.0, 2j], "holds complex numbers"),
        (np.array([True, False]), "holds truth values"),
        ([1.0, True], "holds truth values"),
        (["1.0", "2.0"], "holds text"),
        (np.array([b"1.0"]), "holds text"),
        (np.array([1.0, "x"], object), "holds text"),
        (sparse.eye_array(2), "is a sparse matrix"),
        (MA([1.0, 99999.0], [False, True], dtype=object), "v is masked or missing"),
        ([UnitFloat(1.5)], "carries the unit km"),
        (NoUnit([1.0], "km"), "carries the unit km"),
        (bytearray(b"1.0"), "holds text"),
        (np.array(np.timedelta64(1, "s"), object), "time spans"),
        (TimeDelta(), "time spans"),
        (Elsewhere(), "of which numpy makes no array"),
        ({"a": 1.0}, "no numbers but a dict"),
        ((float(i) for i in range(3)), "no numbers but a generator"),
        (Decimal("0.1"), "no numbers but a Decimal"),
        ([[1.0, 2.0], [3.0]], "is ragged"),
        (2**53 + 1, "whole numbers beyond 2"),
        (np.array([1368000000000000001]), "whole numbers beyond 2"),
        ([10**400], "whole numbers beyond 2"),
        (MA([1.0, 2.0], [False, True]), r"v\[1\] is masked or missing: there must be a number"),
        ([1.0, None], "v is masked or missing"),
        ([MA([1.0], [True])], r"v\[0\] is masked or missing"),
        (Masked([1.0, 2.0], [True, False]), r"v\[0\] is masked"),
        (np.ma.masked, "v is masked"),
        (None, "v is masked or missing"),
    ],
    ids=lambda v: type(v).__name__ if not isinstance(v, str) else None,
)
def test_no_coercion_drops_meaning(value, says):
    with pytest.raises(ValueError, match=says):
        plain("v", value)


@pytest.mark.parametrize(
    ("value", "wanted"),
    [
        (MA([1.0, 99999.0], [False, True]), [1.0, np.nan]),
        (MA([1, -(2**63)], [False, True]), [1.0, np.nan]),
        (MA([[1.0, 2.0]], True), [[np.nan, np.nan]]),
        ([MA([1.0, 2.0], [True, False]), [3.0, np.ma.masked]], [[np.nan, 2.0], [3.0, np.nan]]),
        ([1.0, None, 3], [1.0, np.nan, 3.0]),
        (np.array([1.0, None], object), [1.0, np.nan]),
        (MA([1.0, 99999.0], [False, True], dtype=object), [1.0, np.nan]),
        (np.array(Fraction(1, 2), object), 0.5),
        (Masked([1.0, 2.0], [True, False]), [np.nan, 2.0]),
    ],
)
def test_a_mask_is_a_missing_value(value, wanted):
    np.testing.assert_array_equal(plain("z", value, missing=True), wanted)


@pytest.mark.parametrize(
    "value",
    [
        [1, 2],
        (1.0, 2.0),
        np.array([1, 2], np.uint8),
        np.array([1, 2], np.float32),
        np.array([1, 2], np.longdouble),
        np.array([1, 2], ">f8"),
        np.array([[1.0], [2.0]])[:, 0],
        [np.float64(1), np.int32(2)],
        [Fraction(1), Fraction(2)],
        Quantity([1, 2], ""),
        Measured([1, 2], "dimensionless"),
        MA([1.0, 2.0], [False, False]),
        range(1, 3),
    ],
    ids=lambda v: type(v).__name__,
)
def test_plain_numbers_pass(value):
    out = plain("v", value)
    assert out.dtype == np.float64 and out.tolist() == [1.0, 2.0]


def test_a_plain_array_is_not_copied_and_a_scalar_is_one_number():
    values = np.zeros((3, 2))
    assert plain("v", values) is values
    assert scalar("h", np.float32(2)) == 2.0
    with pytest.raises(ValueError, match=r"h has the shape \(1,\): it must be one number"):
        scalar("h", [2.0])


def test_tables_of_pandas():
    pandas = pytest.importorskip("pandas")
    missing = [1.0, pandas.NA]
    for table in (
        pandas.Series(missing, dtype="Float64"),
        pandas.Series([1, None], dtype="Int64"),
        pandas.Series(missing),
    ):
        np.testing.assert_array_equal(plain("z", table, missing=True), [1.0, np.nan])
    for times in (
        pandas.date_range("2013-05-07", periods=2),
        pandas.Series([pandas.Timestamp("2013-05-07", tz="UTC")]),
    ):
        with pytest.raises(ValueError, match="holds dates: give seconds as float"):
            plain("t", times)
    with pytest.raises(ValueError, match="holds time spans"):
        plain("t", pandas.to_timedelta([1, 2], "s"))
    with pytest.raises(ValueError, match="holds truth values"):
        plain("z", pandas.Series([True, None], dtype="boolean"), missing=True)
    frame = pandas.DataFrame({"x": [1.0, 2.0], "y": [3, 4]}, index=pandas.date_range("2013-05-07", periods=2))
    np.testing.assert_array_equal(plain("z", frame), [[1.0, 3.0], [2.0, 4.0]])


# Every public function has the border

N = 6
T = np.arange(float(N))
Z = np.arange(float(N))[:, None]
H, R, PHI, Q = np.array([[1.0, 0.0]]), np.eye(1), np.array([[1.0, 1.0], [0.0, 1.0]]), 0.01 * np.eye(2)
PRIOR = gaussian(np.zeros(2), [100.0, 100.0])
Y = Information(np.zeros(2), np.eye(2))
SENSOR = Sensor(Z, R, lambda x, t: x[:1], lambda x, t: H)


def step(x, t0, t1):
    return PHI @ x


def jacobian(x, t0, t1):
    return PHI


MODEL = Model(f=step, F=jacobian, Q=Q)


def linear_run(prior=PRIOR, t=T, z=Z, H=H, R=R, Phi=PHI, Q=Q, **options):
    return run(prior, t, Model(F=Phi, Q=Q), [Sensor(z, R, H=H)], **options)


COURSE = linear_run()


def on_line(prior=PRIOR, retract=lambda x, d: x + d, difference=lambda x, y: y - x, smoothed=False):
    line = Manifold(retract=retract, difference=difference, n=2)
    course = run(prior, T, replace(MODEL, manifold=line), [SENSOR])
    return smooth(course) if smoothed else course


CALLS = {  # argument -> a good value, and a call with it
    "gaussian.mean": (np.zeros(2), lambda v: gaussian(v, np.eye(2))),
    "gaussian.cov": (np.eye(2), lambda v: gaussian(np.zeros(2), v)),
    "gaussian.variances": (np.ones(2), lambda v: gaussian(np.zeros(2), v)),
    "linear.predict.Phi": (PHI, lambda v: linear.predict(PRIOR, v, Q)),
    "linear.predict.Q": (Q, lambda v: linear.predict(PRIOR, PHI, v)),
    "linear.predict.prior": (np.eye(2), lambda v: linear.predict(Gaussian(np.zeros(2), v), PHI, Q)),
    "linear.update.H": (H, lambda v: linear.update(PRIOR, Z[0], v, R)),
    "linear.update.R": (R, lambda v: linear.update(PRIOR, Z[0], H, v)),
    "run.linear.t": (T, lambda v: linear_run(t=v)),
    "run.linear.H": (np.tile(H, (N, 1, 1)), lambda v: linear_run(H=v)),
    "run.linear.R": (np.tile(R, (N, 1, 1)), lambda v: linear_run(R=v)),
    "run.linear.Phi": (PHI, lambda v: linear_run(Phi=v)),
    "run.linear.Q(h)": (Q, lambda v: linear_run(Phi=lambda h: (PHI, v))),
    "run.inputs": (np.ones((N, 2)), lambda v: run(PRIOR, T, MODEL, [replace(SENSOR, inputs=v)])),
    "run.params": (np.ones(2), lambda v: run(PRIOR, T, replace(MODEL, params=v), [SENSOR])),
    "run.gate": (np.array(9.0), lambda v: linear_run(gate=v)),
    "Adaptive.floor": (np.array(0.5), lambda v: Adaptive(by="ratio", floor=v)),
    "Adaptive.k1": (np.array(9.0), lambda v: Adaptive(by="ratio", k1=v)),
    "extended.update.h": (np.zeros(1), lambda v: extended.update(PRIOR, Z[0], v, H, R)),
    "extended.predict.f": (np.zeros(2), lambda v: extended.predict(PRIOR, v, PHI, Q)),
    "run.f(x)": (np.zeros(2), lambda v: run(PRIOR, T, replace(MODEL, f=lambda *a: v), [SENSOR])),
    "run.F(x)": (PHI, lambda v: run(PRIOR, T, replace(MODEL, F=lambda *a: v), [SENSOR])),
    "run.R": (R, lambda v: run(PRIOR, T, MODEL, [replace(SENSOR, R=v)])),
    "run.H": (H, lambda v: run(PRIOR, T, MODEL, [Sensor(Z, R, H=v)])),
    "run.Phi": (PHI, lambda v: run(PRIOR, T, Model(F=v, Q=Q), [SENSOR])),
    "run.t": (T, lambda v: run(PRIOR, v, MODEL, [SENSOR], "unscented")),
    "run.h(x)": (np.ones(1), lambda v: run(PRIOR, T, MODEL, [replace(SENSOR, h=lambda *a: v)], "unscented")),
    "run.Q": (Q, lambda v: run(PRIOR, T, replace(MODEL, Q=v), [SENSOR], "unscented")),
    "unscented.sigma_points": (np.eye(2), lambda v: unscented.sigma_points(Gaussian(np.zeros(2), v))),
    "smooth.mean": (COURSE.mean, lambda v: smooth(replace(COURSE, mean=v))),
    "smooth.cov": (COURSE.predicted_cov, lambda v: smooth(replace(COURSE, predicted_cov=v))),
    "smooth.transition": (COURSE.transition, lambda v: smooth(replace(COURSE, transition=v))),
    "smooth_two_filter.H": (H, lambda v: smooth_two_filter(COURSE, Z, v, R)),
    "smooth_information.H": (H, lambda v: smooth_information(T, Z, v, R, (PHI, Q))),
    "smooth_information.prior": (np.eye(2), lambda v: smooth_information(T, Z, H, R, (PHI, Q), Y._replace(matrix=v))),
    "manifold.mean": (PRIOR.mean, lambda v: on_line(prior=(v, PRIOR.cov))),
    "manifold.cov": (PRIOR.cov, lambda v: on_line(prior=(PRIOR.mean, v))),
    "manifold.retract": (np.ones(2), lambda v: on_line(retract=lambda x, d: v)),
    "manifold.difference": (np.ones(2), lambda v: on_line(difference=lambda x, y: v, smoothed=True)),
    "redundancy_numbers.N": (np.ones((3, 1)), lambda v: redundancy_numbers(v, np.ones(3))),
    "redundancy_numbers.variance": (np.ones(3), lambda v: redundancy_numbers(np.ones((3, 1)), v)),
    "whiten_columns.P0": (np.eye(2), lambda v: whiten_columns(v, T, H, R, (PHI, Q), Z)),
    "whiten_columns.columns": (Z, lambda v: whiten_columns(np.eye(2), T, H, R, (PHI, Q), v)),
    "nees.error": (np.zeros((N, 2)), lambda v: nees(v, COURSE.cov)),
    "nees.cov": (COURSE.cov, lambda v: nees(np.zeros((N, 2)), v)),
    "chi_square_bounds.dof": (np.ones(3), chi_square_bounds),
    "van_loan.F": (np.eye(2), lambda v: van_loan(v, Q, 1.0)),
    "van_loan.W": (Q, lambda v: van_loan(np.eye(2), v, 1.0)),
    "van_loan.h": (np.array(1.0), lambda v: van_loan(np.eye(2), Q, v)),
    "integrated_white_noise.q": (np.array(1.0), lambda v: integrated_white_noise(2, 1.0, v)),
    "gauss_markov.tau": (np.array(1.0), lambda v: gauss_markov(1.0, v, 1.0)),
    "gauss_markov.sigma": (np.array(1.0), lambda v: gauss_markov(1.0, 1.0, v)),
    "NormalEquations.block": (np.ones((3, 2)), lambda v: NormalEquations(2).add(v, np.ones(3))),
    "NormalEquations.rhs": (np.ones(3), lambda v: NormalEquations(2).add(np.ones((3, 2)), v)),
    "NormalEquations.weights": (np.ones(3), lambda v: NormalEquations(2).add(np.ones((3, 2)), np.ones(3), v)),
    "NormalEquations.prior": (np.ones(2), lambda v: NormalEquations(2).regularise(1.0, v)),
}
SPOILED = {
    "masked": (lambda v: MA(v, np.arange(v.size).reshape(v.shape) == v.size - 1), "is masked or missing"),
    "unit": (lambda v: Quantity(v, "km"), "carries the unit km"),
    "complex": (lambda v: v + 0j, "complex"),
    "dates": (lambda v: v.astype("datetime64[s]"), "dates: give seconds as float"),
}


@pytest.mark.parametrize("spoil", SPOILED)
@pytest.mark.parametrize("call", CALLS)
def test_every_argument_has_the_border(call, spoil):
    good, function = CALLS[call]
    spoiled, says = SPOILED[spoil]
    function(good)
    with pytest.raises(ValueError, match=says):
        function(spoiled(good))


HIDDEN = MA(Z, np.arange(N)[:, None] == 3)
HIDDEN.data[3] = 99999.0
SEEN = HIDDEN.filled(np.nan)
OBSERVED = {
    "linear.update": lambda z: linear.update(PRIOR, z[3], H, R)[0].mean,
    "run, linear": lambda z: linear_run(z=z).mean,
    "run": lambda z: run(PRIOR, T, MODEL, [replace(SENSOR, z=z)]).mean,
    "run, unscented": lambda z: run(PRIOR, T, MODEL, [replace(SENSOR, z=z)], "unscented").mean,
    "extended.update": lambda z: extended.update(PRIOR, z[3], np.zeros(1), H, R)[0].mean,
    "unscented.update": lambda z: unscented.update(PRIOR, z[3], lambda x: x[:1], R)[0].mean,
    "smooth_two_filter": lambda z: smooth_two_filter(COURSE, z, H, R).mean,
    "smooth_information": lambda z: smooth_information(T, z, H, R, (PHI, Q)).mean,
    "run, adaptive": lambda z: linear_run(z=z, adaptive=Adaptive(by="three_part")).mean,
    "nis": lambda z: np.array(nis(z)),
    "whiteness": lambda z: np.array(whiteness(z, 1).autocorrelation),
    "gate": lambda z: np.array(gate(Innovation(z[:, 0], np.eye(N), z[:, 0]), 0.999999)),
}


@pytest.mark.parametrize("call", OBSERVED)
def test_a_masked_observation_is_a_missing_one(call):
    np.testing.assert_array_equal(OBSERVED[call](HIDDEN), OBSERVED[call](SEEN))


def test_a_trajectory_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match=r"cov of a trajectory has the shape \(6, 3, 3\), with 6 epochs of 2 states"):
        replace(COURSE, cov=np.zeros((N, 3, 3)))


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: integrated_white_noise(2.5, 1.0, 1.0), "order = 2.5: it must be a whole number"),
        (lambda: integrated_white_noise(2, 1.0, 1.0, "3"), "axes holds text"),
        (lambda: gauss_markov(1.0, 2.0, 3.0, True), "order holds truth values"),
        (lambda: whiteness(np.ones((9, 1)), None), "lags is masked or missing"),
        (lambda: chi_square_bounds([1.0], "0.9"), "probability holds text"),
        (lambda: chi_square_bounds([1.0, -2.0]), "dof holds -2"),
        (lambda: chi_square_bounds([1.0, np.nan]), "dof holds nan"),
        (lambda: nis([[np.inf]]), "infinite"),
        (lambda: unscented.spread(2, "1", 2.0, 0.0), "alpha holds text"),
        (lambda: Adaptive(by="innovations", k0=True), "k0 holds truth values"),
        (lambda: Adaptive(by="robust", states=2.5), "states = 2.5: it must be a whole number"),
        (lambda: linear_run(iterations=1.5), "iterations = 1.5: it must be a whole number"),
        (lambda: run(PRIOR, T, Model(), [SENSOR]), "the model has neither f nor F"),
    ],
)
def test_settings_carry_no_more_than_numbers_either(call, says):
    with pytest.raises(ValueError, match=says):
        call()


@pytest.mark.parametrize("change", [lambda s: s + 9, lambda s: s + 0.5, lambda s: s - 1, lambda s: s.astype(bool)])
def test_the_steps_of_a_trajectory_are_indices(change):
    course = linear_run(t=np.arange(3.0), z=np.zeros((3, 1)))
    assert replace(course, step=course.step.astype(float)).step.dtype == np.int64
    with pytest.raises(ValueError, match="step"):
        replace(course, step=change(course.step))
