"""The gravity field as an object: its rule for degrees 0 and 1, its borders, its identity across processes."""

import copy
import pickle

import joblib
import numpy as np
import pytest

from geokalman.physics.harmonics import GravityField, degree_variance, load_field


def parts(n_max=4, seed=5):
    rng = np.random.default_rng(seed)
    C = np.tril(rng.standard_normal((n_max + 1, n_max + 1)))
    S = np.tril(rng.standard_normal((n_max + 1, n_max + 1)))
    C[0, 0], C[1], S[1], S[:, 0] = 1.0, 0.0, 0.0, 0.0
    return C, S


def field(**changes):
    C, S = parts()
    return GravityField(**{"name": "toy", "gm": 4e14, "radius": 6.4e6, "C": C, "S": S, **changes})


def test_vendored_egm96_has_the_published_numbers():
    egm96 = load_field()
    assert egm96.n_max == 360 and egm96.tide_system == "tide_free"
    assert egm96.gm == 3.986004415e14 and egm96.radius == 6378136.3
    assert egm96.C[2, 0] == -4.84165371736e-4
    assert egm96.C[2, 2] == 2.43914352398e-6 and egm96.S[2, 2] == -1.40016683654e-6
    assert egm96.C[70, 70] == -4.70375138826e-10 and egm96.S[70, 70] == -6.48306137833e-10


def test_vendored_jgm3_has_the_published_numbers_and_errors():
    jgm3 = load_field("jgm3")
    assert jgm3.n_max == 70 and jgm3.C[2, 0] == -4.84169548456e-4 and jgm3.C[3, 0] == 9.57170590888e-7
    assert jgm3.sigma_C[2, 0] == 4.66e-11


def test_empty_name_is_egm96_and_degree_is_cut():
    assert load_field("", 20) == load_field("EGM96").truncate(20)
    assert load_field("", 20).C.shape == (21, 21)


def test_unknown_name_says_what_there_is():
    with pytest.raises(FileNotFoundError, match="'EGM9': it is neither EGM96 nor JGM3 nor .* nor an ICGEM file"):
        load_field("EGM9")


@pytest.mark.parametrize("n", [1, 361])
def test_degree_out_of_range_names_the_degrees_of_the_field(n):
    with pytest.raises(ValueError, match=f"n_max = {n} is out of range: EGM96 has degrees 2 to 360"):
        load_field("EGM96", n)


def changed(which, n, m, value):
    C, S = parts()
    {"C": C, "S": S}[which][n, m] = value
    return {"C": C, "S": S}


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"gm": 0.0}, "gm = 0.0 must be positive"),
        ({"radius": np.nan}, "radius = nan must be positive and finite"),
        ({"tide_system": "wet"}, "tide_system 'wet' is none of tide_free"),
        ({"C": np.zeros((2, 2))}, r"C has shape \(2, 2\); it must be \(N\+1, N\+1\) with N >= 2"),
        ({"S": np.zeros((4, 4))}, r"S has shape \(4, 4\), C has \(5, 5\)"),
        ({"sigma_C": np.zeros((5, 5))}, "both or not at all"),
        (changed("C", 3, 2, np.inf), r"C\[3, 2\] = inf is not finite"),
        (changed("S", 1, 3, 1.0), r"S\[1, 3\] = 1.0 must be zero: m exceeds n"),
        (changed("S", 2, 0, 1.0), r"S\[2, 0\] is not"),
        (changed("C", 0, 0, 2.0), r"C\[0, 0\] = 2.0 must be 1"),
        (changed("S", 1, 1, 1e-9), "S11 = 1e-09.*centre of mass"),
    ],
)
def test_what_is_no_field_is_refused(changes, says):
    with pytest.raises(ValueError, match=says):
        field(**changes)


def test_a_field_cannot_be_written_into_and_keeps_its_own_copy():
    C, S = parts()
    one = field(C=C, S=S)
    C[2, 0] = 9.0
    assert one.C[2, 0] != 9.0
    with pytest.raises(ValueError, match="read-only"):
        one.C[2, 0] = 1.0


@pytest.mark.parametrize("twin", [copy.deepcopy, lambda f: pickle.loads(pickle.dumps(f))])
def test_copies_are_equal_hash_alike_and_stay_read_only(twin):
    one = load_field("JGM3", 10)
    other = twin(one)
    assert other == one and hash(other) == hash(one) and joblib.hash(other) == joblib.hash(one)
    assert not other.C.flags.writeable and not other.sigma_S.flags.writeable


def test_fields_that_differ_anywhere_are_not_equal():
    one = field()
    C, _S = parts()
    C[4, 4] = np.nextafter(C[4, 4], 9.0)
    assert field() == one
    for other in (field(name="else"), field(gm=4.1e14), field(C=C), field(tide_system="zero_tide"), "toy"):
        assert one != other
    assert field(sigma_C=np.zeros((5, 5)), sigma_S=np.zeros((5, 5))) != one


def test_rescaling_keeps_the_potential_of_degrees_from_two():
    one = field()
    other = one.rescaled(3.9e14, 6.37e6)
    r = 6.9e6
    for n in range(2, 5):
        before = one.gm / r * (one.radius / r) ** n * one.C[n]
        after = other.gm / r * (other.radius / r) ** n * other.C[n]
        np.testing.assert_allclose(after, before, rtol=1e-14)
    assert other.C[0, 0] == 1.0


def test_with_coefficients_keeps_constants_and_drops_errors():
    jgm3 = load_field("JGM3", 20)
    other = jgm3.with_coefficients(0.5 * jgm3.C + 0.5 * load_field("EGM96", 20).C, jgm3.S, "mean")
    assert (other.name, other.gm, other.radius) == ("mean", jgm3.gm, jgm3.radius) and other.sigma_C is None


def test_degree_variances_of_egm96_are_those_of_the_specification():
    egm96 = load_field()
    variance = degree_variance(egm96.C, egm96.S)
    printed = {10: 1.26315e-13, 30: 3.57376e-15, 50: 1.56162e-15, 70: 5.50948e-16}
    for n, value in printed.items():
        assert variance[n] == pytest.approx(value, rel=5e-6)  # half a unit of the sixth digit
