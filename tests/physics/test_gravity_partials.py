"""The design row of the acceleration approach against the field itself and against equation (49) as it is printed."""

import numpy as np
import pytest

from geokalman.physics.frames import enu_from_ecef
from geokalman.physics.gravity import acceleration
from geokalman.physics.harmonics import GravityField, load_field
from geokalman.physics.partials import (
    column_count,
    column_names,
    design_block,
    design_row,
    from_vector,
    row_table,
    to_vector,
)


def pairs(count, seed):
    rng = np.random.default_rng(seed)
    rA = rng.standard_normal((count, 3))
    rA *= 6834e3 / np.linalg.norm(rA, axis=1)[:, None]
    rB = rA + 127e3 * rng.standard_normal((count, 3))
    e = rA - rB
    return rA, rB, e / np.linalg.norm(e, axis=1)[:, None]


def unit_field(gm, radius, kind, n, m):
    C, S = np.zeros((2, 9, 9))
    C[0, 0] = 1.0
    (C if kind == "C" else S)[n, m] = 1.0
    return GravityField("one coefficient", gm, radius, C, S)


def test_columns():
    assert column_count(70) == 5037 and column_count(30) == 957
    names = column_names(3)
    assert names[:4] == [("C", 2, 0), ("C", 2, 1), ("C", 2, 2), ("C", 3, 0)]
    assert names[7:] == [("S", 2, 1), ("S", 2, 2), ("S", 3, 1), ("S", 3, 2), ("S", 3, 3)]
    for n_max in (2, 5, 30):
        assert len(column_names(n_max)) == len(set(column_names(n_max))) == column_count(n_max)


def test_vector_and_matrices():
    field = load_field("EGM96", 12)
    x = to_vector(field.C, field.S, 12)
    assert [x[i] for i in (0, 5)] == [field.C[2, 0], field.C[3, 2]]
    named = [(field.C if kind == "C" else field.S)[n, m] for kind, n, m in column_names(12)]
    np.testing.assert_array_equal(x, named)
    C, S = from_vector(x, 12)
    C[0, 0] = 1.0
    np.testing.assert_array_equal(C, field.C)
    np.testing.assert_array_equal(S, field.S)


@pytest.mark.parametrize("n_max", [2, 30, 70])
def test_row_times_coefficients_is_the_los_difference(n_max):
    field = load_field("EGM96", n_max)
    rA, rB, e = pairs(60, 1)
    rA[0], rB[0] = [0, 0, 6834e3], [100e3, 0, 6830e3]  # one satellite on the axis
    e[0] = (rA[0] - rB[0]) / np.linalg.norm(rA[0] - rB[0])
    block = design_block(field.gm, field.radius, n_max, rA, rB, e)
    g = acceleration(field, rA) - acceleration(field, rB)
    central = acceleration(field, rA, 0) - acceleration(field, rB, 0)
    los = np.sum(e * (g - central), axis=1)
    np.testing.assert_allclose(block @ to_vector(field.C, field.S, n_max), los, rtol=1e-10, atol=1e-14)


def test_every_column_is_the_field_of_its_coefficient():
    """Each column alone, at the size of a coefficient 1: exchanged or mirrored columns cannot hide in a sum."""
    gm, radius, n_max = 3.986004415e14, 6378136.3, 8
    rA, rB, e = pairs(3, 2)
    block = design_block(gm, radius, n_max, rA, rB, e)
    for j, (kind, n, m) in enumerate(column_names(n_max)):
        field = unit_field(gm, radius, kind, n, m)
        central = acceleration(field, rA, 0) - acceleration(field, rB, 0)
        g = acceleration(field, rA) - acceleration(field, rB) - central
        np.testing.assert_allclose(block[:, j], np.sum(e * g, axis=1), rtol=0, atol=2e-13)


def test_equation_49_as_printed():
    """Rows in east, north, up with e rotated into both local frames, equations (48) and (49), by scipy's Legendre."""
    from scipy.special import assoc_legendre_p_all

    gm, radius, n_max = 3.986004415e14, 6378136.3, 10
    rA, rB, e = pairs(4, 3)
    block = design_block(gm, radius, n_max, rA, rB, e)

    def local_row(r, e):
        d = np.linalg.norm(r)
        phi, lam, q = np.arcsin(r[2] / d), np.arctan2(r[1], r[0]), radius / d
        P, dP = assoc_legendre_p_all(n_max, n_max, np.sin(phi), norm=True, diff_n=1)[:, :, : n_max + 1]
        e_e, e_n, e_u = enu_from_ecef(r) @ e
        row = []
        for kind, n, m in column_names(n_max):
            # scipy has the Condon-Shortley phase and the norm 1 instead of 2 (2 - delta_m0)
            sign = (-1) ** m * np.sqrt(2 * (2 - (m == 0)))
            p, slope = sign * P[n, m], sign * dP[n, m] * np.cos(phi)
            cos, sin = np.cos(m * lam), np.sin(m * lam)
            f, df = (cos, -m * sin) if kind == "C" else (sin, m * cos)
            row.append(q**n * (e_e * df * p / np.cos(phi) + e_n * f * slope - e_u * (n + 1) * f * p))
        return gm / d**2 * np.array(row)

    written_out = [local_row(a, u) - local_row(b, u) for a, b, u in zip(rA, rB, e, strict=True)]
    limit = 8 * n_max**2 * np.spacing(np.abs(block).max())
    np.testing.assert_allclose(block, written_out, rtol=0, atol=limit)


def test_compiled_row_equals_python():
    rA, rB, e = (x[0] for x in pairs(1, 4))
    table = row_table(9)
    compiled, plain = np.empty(column_count(9)), np.empty(column_count(9))
    design_row(rA, rB, e, 4e14, 6.4e6, 9, table, compiled)
    getattr(design_row, "py_func", design_row)(rA, rB, e, 4e14, 6.4e6, 9, table, plain)
    np.testing.assert_allclose(compiled, plain, rtol=0, atol=1e-13)


def test_out_is_filled_in_place():
    rA, rB, e = pairs(2, 5)
    out = np.full((2, column_count(4)), np.nan)
    assert design_block(4e14, 6.4e6, 4, rA, rB, e, out) is out
    np.testing.assert_array_equal(out, design_block(4e14, 6.4e6, 4, rA, rB, e))


def test_errors():
    rA, rB, e = pairs(2, 6)
    with pytest.raises(ValueError, match="n_max = 1 leaves nothing to recover"):
        design_block(4e14, 6.4e6, 1, rA, rB, e)
    with pytest.raises(ValueError, match=r"must be as many"):
        design_block(4e14, 6.4e6, 4, rA, rB[:1], e)
    with pytest.raises(ValueError, match=r"line of sight 0, .* has length 2, it must be 1"):
        design_block(4e14, 6.4e6, 4, rA, rB, 2 * e)
    with pytest.raises(ValueError, match=r"out is float32 .* must be C-contiguous float64 \(2, 21\)"):
        design_block(4e14, 6.4e6, 4, rA, rB, e, np.empty((2, 21), np.float32))
    with pytest.raises(ValueError, match=r"shape \(3,\): degree 4 has 21 columns"):
        from_vector(np.zeros(3), 4)
