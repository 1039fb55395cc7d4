"""Every figure of the airborne part: the data in its lines, its labels with units, in both themes."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from artists import assert_dressed, line
from matplotlib.colors import same_color

from geokalman import style
from geokalman.airborne import figures
from geokalman.style import METHODS

T = np.linspace(0, 900, 400)
WAVE = 10 * np.sin(T / 100)


def labels(figure):
    return [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes]


def test_six_panels(theme):
    panel = figures.Panel("line 1", T, {"reference": WAVE, "fb": WAVE + 1, "forward": WAVE - 1}, np.full(400, 0.5))
    names = {"reference": "GT-like", "fb": "SAGFB", "forward": "SAGK"}
    figure = figures.six_panels([panel] * 5, names)
    assert_dressed(figure, theme)
    assert [axes.get_visible() for axes in figure.axes] == [True] * 5 + [False]
    axes = figure.axes[0]
    assert [line(axes, n).get_linestyle() for n in ("GT-like", "SAGFB", "SAGK")] == ["-", "--", ":"]
    np.testing.assert_array_equal(line(axes, "SAGFB").get_ydata(), WAVE + 1)
    assert axes.get_ylabel() == "gravity [mGal]" and figure.axes[4].get_xlabel() == "time [s]"
    band = axes.collections[0].get_paths()[0].vertices[:, 1]
    assert band.max() == pytest.approx(WAVE.max() + 2.0) and band.min() == pytest.approx(WAVE.min())


def test_gauss_markov(theme):
    figure = figures.gauss_markov(
        T,
        np.exp(-T / 100),
        np.geomspace(1e3, 1e5, 50),
        np.geomspace(1, 1e4, 50),
        T,
        np.array([WAVE, -WAVE, 0 * WAVE]),
        100.0,
    )
    assert_dressed(figure, theme)
    assert labels(figure) == [
        ("lag [s]", "correlation"),
        ("wavelength [km]", "density [mGal²/Hz]"),
        ("time [s]", "gravity [mGal]"),
    ]
    assert figure.axes[1].xaxis_inverted() and len(figure.axes[2].get_lines()) == 3


def test_steady(theme):
    figure = figures.steady(T, np.full(400, 2.0), np.full(400, 1.0), (2.0, 1.0))
    assert_dressed(figure, theme)
    assert line(figure.axes[0], figures.NAMES["fb"]).get_ydata()[0] == 1.0
    assert labels(figure) == [("time [s]", "standard deviation [mGal]")]
    assert figure.axes[0].get_ylim() == pytest.approx((0, 4.4))


def test_table_one_shows_the_printed_means(theme):
    figure = figures.table_one(
        {"forward": np.array([1.1, 1.2]), "fb": np.array([0.9, 0.8])}, {"forward": 1.1273, "fb": 0.9073}
    )
    assert_dressed(figure, theme)
    axes = figure.axes[0]
    levels = {float(artist.get_ydata()[0]) for artist in axes.get_lines() if artist.get_linestyle() == "--"}
    assert levels == {1.1273, 0.9073}
    assert axes.get_ylabel() == "mean of six RMS [mGal]"


def test_starts_keep_their_colours(theme):
    errors = {"literal": WAVE, "wide": WAVE / 10, "prior": WAVE / 5}
    figure = figures.starts(T, errors, {"wide": np.ones(400), "prior": np.full(400, 0.8)})
    assert_dressed(figure, theme)
    upper, lower = figure.axes
    for name in ("wide", "prior"):
        assert same_color(line(upper, name).get_color(), line(lower, name).get_color())
    assert lower.get_ylim()[1] == pytest.approx(1.1) and upper.get_yscale() == "log"


def test_consistency(theme):
    figure = figures.consistency(
        np.array([0.99, 1.01]), {"forward": np.array([0.5, 2]), "fb": np.array([0.6, 1.5])}, {"nis": (0.94, 1.06)}
    )
    assert_dressed(figure, theme)
    assert labels(figure) == [("line", "mean NIS"), ("line", "mean NEES of gravity")]


def test_gains(theme):
    w = np.geomspace(5e3, 6e4, 30)
    figure = figures.gains({"a": w}, {"a": {"smoother": w / 6e4}}, (w, w / 1e3))
    assert_dressed(figure, theme)
    np.testing.assert_allclose(line(figure.axes[0], "smoother").get_xdata(), w / 1e3)
    assert labels(figure) == [("wavelength [km]", "gain"), ("wavelength [km]", "delay [s]")]


def test_fir_scan(theme):
    scans = {"a": np.array([0.5, 0.3])}, {"a": {"smoother": 0.2}}, {"a": np.array([0.4, 0.2])}
    figure = figures.fir_scan(np.array([60.0, 100.0]), *scans)
    assert_dressed(figure, theme)
    np.testing.assert_array_equal(line(figure.axes[0], "FIR low-pass, clean ends").get_ydata(), [0.4, 0.2])
    np.testing.assert_array_equal(line(figure.axes[0], "FIR low-pass, ends repeated").get_ydata(), [0.5, 0.3])
    assert labels(figure) == [("cutoff of the FIR [s]", "sd against truth [mGal]")]


def test_spectra(theme):
    figure = figures.spectra(np.linspace(0, 1, 10), {"gravity": np.arange(1.0, 11)})
    assert_dressed(figure, theme)
    assert len(line(figure.axes[0], "gravity").get_xdata()) == 9
    assert labels(figure) == [("frequency [Hz]", "power density [mGal²/Hz]")]


def test_per_line(theme):
    figure = figures.per_line(["1", "2"], {"fb": np.array([1.0, 0.5]), "grid": np.array([0.4, 0.2])})
    assert_dressed(figure, theme)
    np.testing.assert_array_equal(line(figure.axes[0], "forward-backward smoother, mean 0.750").get_ydata(), [1.0, 0.5])
    assert figure.axes[0].get_ylabel() == "sd against ground gravity [mGal]"


def test_repeats(theme):
    passes = np.vstack([WAVE, WAVE + 1.0])
    figure = figures.repeats(T * 60, {"fb": passes})
    assert_dressed(figure, theme)
    np.testing.assert_allclose(line(figure.axes[-1], METHODS["fb"].label).get_ydata(), np.sqrt(0.5))
    assert figure.axes[-1].get_xlabel() == "along the line [km]"


def test_downward_and_timings(theme):
    for figure, expected in (
        (
            figures.downward(np.geomspace(3, 60, 20), {"330 m": np.linspace(1, 2, 20)}),
            ("wavelength [km]", "factor of the noise"),
        ),
        (figures.timings([2.0, 50.0], {"forward": [3.0, 3.0]}), ("rate of the filter [Hz]", "time per epoch [µs]")),
    ):
        assert_dressed(figure, theme)
        assert labels(figure)[0] == expected


def test_tracks(theme):
    north = np.linspace(-30e3, 30e3, 100)
    figure = figures.tracks([("1", np.zeros(100), north), ("2", np.full(100, 2e3), north[::-1])], [slice(10, 90)] * 2)
    assert_dressed(figure, theme)
    assert labels(figure) == [("east [km]", "north [km]")]
    assert {text.get_text() for text in figure.axes[0].texts} >= {"1", "2"}
    assert len(line(figure.axes[0], "line").get_ydata()) == 80


def test_along_lines(theme):
    x = np.linspace(0, 1e4, 200)
    figure = figures.along_lines(
        [(x, x), (x, x + 1e3)],
        {"gravity": [x / 1e3] * 2, "difference": [np.sin(x)] * 2},
        {"gravity": False, "difference": True},
    )
    assert_dressed(figure, theme)
    low, high = figure.axes[1].collections[0].get_clim()
    assert low == -high
    assert figure.axes[0].get_xlabel() == "east [km]"


def test_grids(theme):
    k = np.arange(10.0)
    figure = figures.grids(
        k,
        k,
        {"gravity": np.outer(k, k), "difference": np.outer(k - 4, k)},
        {"gravity": False, "difference": True},
        [(k, k)],
    )
    assert_dressed(figure, theme)
    low, high = figure.axes[1].collections[0].get_clim()
    assert low == -high and figure.axes[0].get_ylabel() == "north [km]"


def test_drawings_name_every_block_and_step(theme):
    figure = figures.system()
    assert_dressed(figure, theme)
    shown = {text.get_text() for text in figure.axes[0].texts}
    assert shown >= {part for parts in figures.BLOCKS.values() for part in parts} | set(figures.BLOCKS)
    figure = figures.chain()
    assert {text.get_text() for text in figure.axes[0].texts} >= {cell for row in figures.STEPS for cell in row} | {
        "1",
        "5",
    }


def test_the_schematic_names_what_is_measured_and_both_passes(theme):
    figure = figures.schematic()
    assert_dressed(figure, theme)
    shown = " ".join(text.get_text() for text in figure.axes[0].texts)
    for words in ("specific force", "GNSS", "ellipsoid", "forward filter", "backward filter", "gravity disturbance"):
        assert words in shown


def test_names_are_those_of_the_style_and_tell_low_passes_apart():
    assert all(figures.NAMES[key] == METHODS[key].label for key in ("forward", "fb", "contractor", "grid", "joint"))
    assert figures.low_pass("fircut100") == "FIR low-pass 100 s, clean ends"
    assert (
        figures.low_pass("butter60") == "Butterworth low-pass 60 s" and figures.low_pass("fir60") == "FIR low-pass 60 s"
    )


def test_another_ink_is_seen(theme):
    figure, axes = plt.subplots()
    assert_dressed(figure, theme)
    axes.set_xlabel("time [s]", color="red")
    with pytest.raises(AssertionError):
        assert_dressed(figure, theme)


SMOKE = {
    "six_panels": lambda: figures.six_panels(
        [figures.Panel("line 1", T, {"reference": WAVE, "fb": WAVE + 1, "forward": WAVE - 2}, np.ones(400))] * 2,
        {"reference": "GT-like", "fb": "SAGFB", "forward": "SAGK"},
    ),
    "starts": lambda: figures.starts(T, {"literal": WAVE, "wide": WAVE / 9}, {"wide": np.ones(400)}),
    "fir_scan": lambda: figures.fir_scan(
        np.array([60.0, 100.0, 140.0]), {"a": np.array([3.0, 1.0, 2.0])}, {"a": {"smoother": 0.9}}, {"a": np.ones(3)}
    ),
    "per_line": lambda: figures.per_line(["1", "2", "3"], {"joint": np.array([1.0, 0.5, 0.7]), "grid": np.ones(3)}),
    "grids": lambda: figures.grids(
        np.arange(10.0), np.arange(8.0), {"gravity": np.outer(np.arange(8.0), np.arange(10.0))}, {"gravity": False},
        [(np.arange(10.0), np.full(10, 4.0))],
    ),
    "system": figures.system,
    "chain": figures.chain,
}  # fmt: skip

compare = pytest.mark.mpl_image_compare(
    baseline_dir="baseline", remove_text=True, tolerance=10, style="default",
    savefig_kwargs={"dpi": 60, "facecolor": "auto", "metadata": {"Software": None}},
)  # fmt: skip


@compare
@pytest.mark.parametrize("name", sorted(SMOKE))
def test_smoke(name):
    with style.theme("light"):
        return SMOKE[name]()


@compare
@pytest.mark.parametrize("name", ["chain", "grids"])
def test_smoke_dark(name):
    with style.theme("dark"):
        return SMOKE[name]()
