"""What a filter believes: a model and sensors, as matrices or functions.

Compiled functions (`numba.njit` with the signatures below) write into the arrays that they are given and return 0, or a
positive number of their own that stops the run. An array of size zero is not wanted. u is the row of the inputs for
this step or epoch, p the parameters.

    PROPAGATE(t0, t1, x, u, p, x_out, F, Q)   state at t1 from that at t0, its Jacobian and the noise of the step
    OBSERVE(t, x, u, p, h, H, R)              predicted observation, its Jacobian; R comes in as the sensor's and may be
                                              changed (of sigma points, that of the first, the mean, counts); where h is
                                              NaN an extended filter takes the component as missing
    RETRACT(x, d, x_out)                      state x [+] d of an error d
    DIFFERENCE(x, y, d)                       error d that leads from x to y
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numba import njit, types
from numba.extending import is_jitted

from geokalman.kalman.checks import array

vector = types.float64[::1]
matrix = types.float64[:, ::1]
PROPAGATE = types.int64(types.float64, types.float64, vector, vector, vector, vector, matrix, matrix)
OBSERVE = types.int64(types.float64, vector, vector, vector, vector, matrix, matrix)
RETRACT = types.void(vector, vector, vector)
DIFFERENCE = types.void(vector, vector, vector)


def _add(x, d, x_out):
    """Retract in a flat space: x_out = x + d."""
    for j in range(x.size):
        x_out[j] = x[j] + d[j]


def _subtract(x, y, d):
    """Subtract in a flat space: d = y - x."""
    for j in range(x.size):
        d[j] = y[j] - x[j]


def is_kernel(function: Callable, signature) -> bool:
    """Recognise a compiled function by its arguments, also where compilation is off.

    >>> is_kernel(_add, RETRACT), is_kernel(lambda x: x, RETRACT)
    (True, False)
    """
    code = getattr(getattr(function, "py_func", function), "__code__", None)
    return code is not None and code.co_argcount == len(signature.args)


def checked_once(check: Callable, name: str, function: Callable, *shape: int | None) -> Callable:
    """Wrap a function whose first value is checked and whose later ones are trusted.

    >>> checked_once(array, "f(x)", lambda x: [2.0 * x], 1)(3.0).tolist()
    [6.0]
    """
    trusted = False

    def checked(*arguments):
        nonlocal trusted
        value = function(*arguments)
        if not trusted:
            value, trusted = check(name, value, *shape), True
        return value

    return checked


@dataclass(frozen=True, kw_only=True)
class Manifold:
    """A state space that is not flat.

    x [+] d retracts an error d (n,) into a state, y [-] x is the error from x to y.
    retract, difference : compiled, `RETRACT` and `DIFFERENCE`; or Python functions retract(x, d) -> x [+] d and
    difference(x, y) -> y [-] x. n : number of components of an error.
    Source: Hertzberg et al. (2013), Information Fusion 14, 57-77.

    >>> circle = Manifold(
    ...     retract=lambda x, d: (x + d) % 360.0, difference=lambda x, y: (y - x + 180.0) % 360.0 - 180.0, n=1
    ... )
    >>> circle.difference(350.0, 10.0), circle.retract(350.0, 20.0)  # [deg]
    (20.0, 10.0)
    """

    retract: Callable
    difference: Callable
    n: int

    @property
    def compiled(self) -> bool:
        """Tell whether both functions are compiled."""
        return is_jitted(self.retract) and is_jitted(self.difference)

    def kernels(self, nx: int) -> tuple[Callable, Callable]:
        """Give both functions with the compiled signatures, for states of nx numbers."""
        if is_kernel(self.retract, RETRACT) and is_kernel(self.difference, DIFFERENCE):
            return self.retract, self.difference
        of_x = checked_once(array, "retract(x, d)", self.retract, nx)
        to_y = checked_once(array, "difference(x, y)", self.difference, self.n)

        def retract(x, d, x_out):
            x_out[:] = of_x(x, d)

        def difference(x, y, d):
            d[:] = to_y(x, y)

        return retract, difference


@functools.cache
def flat() -> Manifold:
    """Make the flat space, whose functions are compiled at the first run and not at import.

    >>> flat().n
    0
    """
    return Manifold(
        retract=njit([RETRACT], cache=True)(_add), difference=njit([DIFFERENCE], cache=True)(_subtract), n=0
    )


@dataclass(frozen=True, kw_only=True)
class Model:
    """Motion x_next = f(x) + w, w ~ N(0, Q), in one of three forms.

    linear   : F, Q matrices (n, n), stacks (N - 1, n, n), or F(h), which gives the pair for a step of h [s]
    Python   : f(x, t0, t1) : (n,), F(x, t0, t1) : (n, n) = df/dx (extended filter only), Q matrix, stack or Q(t0, t1)
    compiled : f with the signature `PROPAGATE`, inputs : (N - 1, i), params : (p,); Q is what f finds in its argument
               Q, and may write; F is not given
    manifold : where the state is no vector (extended filter only); the prior's cov is then that of the error

    >>> from geokalman.kalman import gaussian, run
    >>> half = Model(f=lambda x, t0, t1: 0.5 * x, F=lambda x, t0, t1: [[0.5]], Q=[[1.0]])
    >>> course = run(gaussian([8.0], [4.0]), [0.0, 1.0], half, [Sensor([[float("nan")]] * 2, [[1.0]], H=[[1.0]])])
    >>> course.mean[:, 0].tolist(), course.cov[:, 0, 0].tolist()
    ([8.0, 4.0], [4.0, 2.0])
    """

    f: Callable | None = None
    F: Any = None
    Q: Any = None
    inputs: Any = None
    params: Any = ()
    manifold: Manifold | None = None


@dataclass(frozen=True)
class Sensor:
    """One instrument's observations z = h(x, t) + v, v ~ N(0, R), on the epochs of a run.

    z : (N, m), NaN where a component or an epoch is missing [its units]; R : (m, m) or (N, m, m).
    linear   : H : (m, n) or (N, m, n), no h; sequential: component by component (fast), else jointly
    Python   : h(x, t) : (m,) and H(x, t) : (m, n) = dh/dx, needed by the extended filter only
    compiled : h with the signature `OBSERVE`, inputs : (N, i), params : (p,)
    What one sensor observes in an epoch is processed jointly at one linearisation; sensors follow one another, each at
    the state that the one before left. On a manifold H is the derivative by the error.

    >>> from geokalman.kalman import gaussian, run
    >>> square = Sensor([[5.0]], [[4.0]], h=lambda x, t: x**2, H=lambda x, t: [2.0 * x])
    >>> run(gaussian([2.0], [0.25]), [0.0], Model(F=[[1.0]], Q=[[0.0]]), [square]).mean.item()
    2.125
    """

    z: Any
    R: Any
    h: Callable | None = None
    H: Any = None
    inputs: Any = None
    params: Any = ()
    sequential: bool = True
