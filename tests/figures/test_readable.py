"""Pictures that cannot be misread: hatching on the cells, scales that begin at 0 or have it in the
middle, kinds of lines, and texts that do not stand on each other."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import stickslip as ss
from figures.boxes import hatched, misread
from orbits.examples import SLIDER
from stickslip.figures.basin import plot_basin
from stickslip.figures.drawing.cells import cell_edges, hatch_cells
from stickslip.figures.drawing.style import BAND, BLUE, EQUILIBRIUM, new_figure
from stickslip.figures.orbits import plot_branch
from stickslip.sweeps.request.scales import colour_scale

TOY = ss.catalogue.rocking_toy()


# -- cells -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("log", [False, True])
def test_hatching_is_exactly_on_the_cells(log: bool) -> None:
    rng = np.random.default_rng(2)
    x, y = np.geomspace(0.1, 10.0, 7), np.linspace(-1.0, 2.0, 5)
    edges = cell_edges(x, log), cell_edges(y)
    where = rng.uniform(size=(7, 5)) < 0.4
    axes = new_figure(4.0, 3.0).add_subplot()
    hatch_cells(axes, edges, where, "x")
    for letter, corners in hatched(axes):
        assert letter == "x"
        covered = np.zeros_like(where)
        for low, high in zip(corners.min(axis=1), corners.max(axis=1), strict=True):
            i, j = (np.searchsorted(e, v) for e, v in zip(edges, low, strict=True))
            k, m = (np.searchsorted(e, v) for e, v in zip(edges, high, strict=True))
            assert np.array_equal([edges[0][i], edges[1][j]], low)
            assert np.array_equal([edges[0][k], edges[1][m]], high)
            assert not np.any(covered[i:k, j:m])
            covered[i:k, j:m] = True
        np.testing.assert_array_equal(covered, where)


def test_one_uncertified_state_of_a_basin_is_one_cell() -> None:
    over = {"psi": "-1.0:1.0:7", "d_psi": "-0.9:0.9:5"}
    data = ss.basin(TOY, over, initial={"x_R": 0.0}).dataset.copy(deep=True)
    data["lacking"].values[:] = 0
    data["lacking"].values[3, 2] = 1
    (axes,) = plot_basin(data).axes
    mesh = axes.collections[0].get_coordinates()  # type: ignore[attr-defined]
    for _, corners in hatched(axes):
        assert corners.shape == (1, 5, 2)
        np.testing.assert_allclose(corners[0, 0], mesh[2, 3])
        np.testing.assert_allclose(corners[0, 2], mesh[3, 4])


# -- scales ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("measure", "values", "ends", "kind"),
    [
        ("amplitude", [0.9, 1.0], (0.0, 1.0), "one way"),
        ("amplitude:x", [np.nan, 2.0], (0.0, 2.0), "one way"),
        ("amplitude", [0.0, 0.0], (0.0, 1.0), "one way"),
        ("period", [3.0, 4.0], (0.0, 4.0), "one way"),
        ("energy_per_cycle", [3.0], (0.0, 3.0), "one way"),
        ("stick_fraction", [0.4, 0.5], (0.0, 1.0), "one way"),
        ("speed", [-0.1, 0.4], (-0.4, 0.4), "both ways"),
        ("speed", [0.1, 0.4], (0.1, 0.4), "one way"),
        ("lyapunov", [-2.0, 0.1], (-2.0, 2.0), "both ways"),
        ("phase:x", [0.1, 0.2], (-np.pi, np.pi), "round"),
        ("mine", [-1.0, 3.0], (-3.0, 3.0), "both ways"),
        ("mine", [2.0, 2.0], (1.5, 2.5), "one way"),
        ("mine", [], (0.0, 1.0), "one way"),
    ],
)
def test_scales(measure: str, values: list[float], ends: tuple[float, float], kind: str) -> None:
    found = colour_scale(measure, np.array(values))
    assert (found.low, found.high) == pytest.approx(ends)
    assert found.kind == kind


def test_maps_have_these_scales() -> None:
    over = {"P": "0.8:1.4:7", "delta": "0.02:0.1:8"}
    formulas = ["signed = speed - 0.1", "rate = 1/period", "moves = 1 - stick_fraction"]
    found = ss.sweep(TOY, over, ["amplitude", "stick_fraction", *formulas])
    names = "amplitude", "stick_fraction", "signed", "rate", "moves"
    drawn = [found.plot(name).axes[0].collections[-1] for name in names]
    amplitude, share, signed, rate, moves = drawn
    assert rate.get_clim()[0] == 0.0 and moves.get_clim() == (0.0, 1.0)
    assert amplitude.get_clim()[0] == 0.0
    assert share.get_clim() == (0.0, 1.0)
    low, high = signed.get_clim()
    assert low == -high
    assert signed.get_cmap().name != amplitude.get_cmap().name


# -- lines -----------------------------------------------------------------------------------------


@cache
def steady() -> ss.Branch:
    return ss.continue_equilibrium(SLIDER, "V", (0.22, 0.4))


@cache
def cycles() -> ss.Branch:
    cycle = ss.find_cycle(SLIDER, {"U": 1.3, "alpha": 1.2}, parameters={"V": 0.2255})
    return ss.continue_cycle(cycle, "V", (0.223, 0.228))


def test_equilibria_and_cycles_stable_and_unstable_are_four_kinds_of_lines() -> None:
    figure = plot_branch(steady(), ["U"], others=[cycles()])
    kinds = {}
    for handle, text in zip(
        figure.legends[0].legend_handles, figure.legends[0].get_texts(), strict=True
    ):
        if handle is not None and ("cycle" in text.get_text() or "equil" in text.get_text()):
            line = handle
            kinds[text.get_text()] = (
                to_hex(line.get_color()),  # type: ignore[attr-defined]
                line.get_linewidth(),  # type: ignore[attr-defined]
                line.is_dashed(),  # type: ignore[attr-defined]
            )
    assert len(set(kinds.values())) == len(kinds) >= 4
    for text, (colour, width, dashed) in kinds.items():
        assert dashed == text.startswith("unstable")
        assert (colour == EQUILIBRIUM.lower()) == ("equilibrium" in text)
        assert (width < 1.5) == ("equilibrium" in text)
    assert kinds["unstable cycle"][0] == BLUE.lower()
    # Alone, too, a branch says what it is of.
    assert "stable equilibrium" in {t.get_text() for t in steady().plot().legends[0].get_texts()}


def hopfs() -> ss.Branch:
    point = next(point for point in steady().special if point.kind == "Hopf")
    return ss.hopf_curve(SLIDER, point, "V", "nu", ranges={"V": (0.02, 0.5), "nu": (0.03, 0.1)})


def test_the_stable_side_of_a_hopf_curve_is_shaded() -> None:
    """Where equilibria beside it are stable, as their own eigenvalues say."""
    curve = hopfs()
    (axes,) = curve.plot().axes
    (shade,) = axes.collections
    assert to_hex(tuple(np.asarray(shade.get_facecolor())[0])).upper() == BAND.upper()
    strips = shade.get_paths()
    assert len(strips) == curve.points.sizes["point"] - 1
    for strip in strips[:: len(strips) // 4]:
        on, _, _, off = np.asarray(strip.vertices)[:4]
        for side, stable in ((1.0, True), (-1.0, False)):
            V, nu = on + 0.3 * side * (off - on)
            values = {"V": float(V), "nu": float(nu)}
            (found,) = ss.equilibria(SLIDER, parameters=values).isolated
            assert found.stable == stable
    assert "equilibrium stable on this side" in {
        text.get_text() for legend in axes.figure.legends for text in legend.get_texts()
    }


def test_how_fast_an_oscillation_grows_beside_a_hopf_curve() -> None:
    """The slope of the real part, from equilibria with other parameters."""
    points = hopfs().points
    assert np.all(points["unstable_others"] == 0)
    here = {name: float(points[name][7]) for name in ("V", "nu")}
    for name, step in (("V", 1e-4), ("nu", 1e-4)):
        real = []
        for side in (1.0, -1.0):
            values = {**here, name: here[name] + side * step}
            (found,) = ss.equilibria(SLIDER, parameters=values).isolated
            real.append(max(np.real(found.eigenvalues)))
        slope = (real[0] - real[1]) / (2.0 * step)
        assert float(points[f"growth_{name}"][7]) == pytest.approx(slope, rel=1e-4)


# -- texts -----------------------------------------------------------------------------------------


def small_numbers() -> Figure:
    """A map whose numbers have powers of ten, on all axes."""
    over = {"V": "1e-6:4e-6:4", "F": "2e4:3e5:9"}
    return ss.sweep(ss.catalogue.bowed_string(), over, ["amplitude", "mean_force"]).plot()


PICTURES: dict[str, Callable[[], Figure]] = {
    "map": lambda: ss.sweep(
        TOY, {"P": "0.6:1.6:12", "delta": "log:0.01:0.2:9"}, ["period", "speed"]
    ).plot(),
    "outcomes": lambda: ss.sweep(TOY, {"P": "0.6:1.6:9", "delta": "0.01:0.2:9"}, ["speed"]).plot(
        "outcome"
    ),
    "multiples": lambda: ss.sweep(
        TOY, {"P": "0.6:1.6:8", "delta": "0.01:0.2:8", "psi": "0:1:7"}, ["speed"]
    ).plot(),
    "lines": lambda: ss.sweep(
        TOY, {"P": "0.6:1.6:12", "delta": [0.02, 0.05]}, ["speed", "period"]
    ).plot(),
    "dots": lambda: ss.sweep(
        TOY, {"P,delta": "halton:30; 0.6:1.6; 0.01:0.2"}, ["speed", "period"]
    ).plot(),
    "carried": lambda: ss.sweep(
        ss.catalogue.forced_oscillator(), {"omega": "0.5:1.5:9"}, ["amplitude"], carry="omega both"
    ).plot(),
    "small numbers": small_numbers,
    "basin": lambda: ss.basin(
        TOY, {"psi": "-1:1:9", "d_psi": "-0.9:0.9:7"}, initial={"x_R": 0.0}
    ).plot(),
    "branches": lambda: plot_branch(steady(), others=[cycles()]),
    "Hopf curve": lambda: hopfs().plot(),
    "gait": lambda: ss.find_cycle(TOY).plot(),
    "equilibria": lambda: ss.equilibria(ss.catalogue.belt_block()).plot(),
    "response": lambda: ss.frequency_response(
        ss.catalogue.jenkins_oscillator(), "omega", (0.5, 1.5), points=12
    ).plot(),
    "play": lambda: ss.play("5*t - t**2", 0.5, (0, 5), initial=0.0).plot(),
}


@pytest.mark.parametrize("picture", PICTURES)
def test_texts_do_not_stand_on_each_other(picture: str) -> None:
    assert misread(PICTURES[picture]()) == []


@pytest.mark.parametrize("scale", ["linear", "log"])
@pytest.mark.parametrize("low", [0.0612, 1234.567, 3.0, 0.2])
@pytest.mark.parametrize("width", [0.002, 0.3, 30.0])
def test_numbers_at_narrow_axes_have_room(scale: str, low: float, width: float) -> None:
    figure = new_figure(5.0, 2.0)
    row: list[Axes] = list(figure.subplots(1, 3))
    for axes in row:
        axes.set_xscale(scale)
        axes.plot([low, low * (1.0 + width)], [0.0, 1.0])
        axes.set_xlabel("x  [m]")
    assert misread(figure) == []
