"""Pictures of long-run behaviour: what they show, read back from what was drawn."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from oracles import den_hartog
from orbits.examples import SLIDER
from stickslip import catalogue
from stickslip.errors import DeclarationError
from stickslip.figures.basin import plot_basin
from stickslip.figures.drawing.smooth import PIECES, smooth_curve
from stickslip.figures.drawing.style import BLUE, SLIP, STICK_LINE
from stickslip.figures.gait import plot_gait
from stickslip.figures.orbits import plot_branch
from stickslip.figures.phase_portrait import plot_phase_portrait
from stickslip.figures.poincare import crossings, plot_return_map
from stickslip.figures.spectrum import plot_eigenvalues
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.orbits.equilibria.finding import equilibria
from stickslip.sweeps.basin import basin
from stickslip_paper.sections.scaling import lowest_order

V = {"V": 0.2255}


@cache
def gait() -> Cycle:
    return find_cycle(catalogue.rocking_toy())


@cache
def slider_cycle() -> Cycle:
    return find_cycle(SLIDER, {"U": 1.3, "alpha": 1.2}, parameters=V)


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for shown in figure.legends for text in shown.get_texts()]


def drawn(axes: Axes, colour: str, style: str | None = None) -> list[np.ndarray]:
    lines = [
        line for line in axes.get_lines() if to_hex(line.get_color()).upper() == colour.upper()
    ]
    return [
        np.asarray(line.get_xydata())
        for line in lines
        if style is None or line.get_linestyle() == style
    ]


def test_gait_diagram() -> None:
    figure = plot_gait(gait(), periods=2)
    bars, positions = figure.axes
    assert [label.get_text() for label in bars.get_yticklabels()] == ["right leg", "left leg"]
    blue = [
        c
        for c in bars.collections
        if to_hex(tuple(np.asarray(c.get_facecolor())[0])).upper() == SLIP[1]
    ]
    moving = sum(np.ptp(np.asarray(path.vertices)[:, 0]) for c in blue for path in c.get_paths())
    assert moving == pytest.approx(2 * sum(share.slip_time for share in gait().contacts.values()))
    legend = bars.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["stick", "slip forward"]
    for line in positions.get_lines():
        x = np.asarray(line.get_ydata())
        assert x[-1] - x[0] == pytest.approx(2 * gait().drift, abs=1e-6)
        assert np.all(np.diff(x) > -1e-9)
    assert positions.get_ylabel() == r"$x_{R}$, $x_{L}$  [$\mathrm{m}$]"


def test_gait_diagram_needs_contacts() -> None:
    cycle = find_cycle(catalogue.rocking_oscillator())
    with pytest.raises(DeclarationError, match="no contacts"):
        plot_gait(cycle)


def test_return_map_and_cobweb() -> None:
    psi = lowest_order(0.5)
    figure = plot_return_map({"lowest order": psi, "steeper": lowest_order(0.8)}, (0.0, 0.95), 0.8)
    (axes,) = figure.axes
    x = np.linspace(0.0, 0.95, 201)
    fixed = crossings(x, np.array([psi(g) for g in x]))
    assert fixed == pytest.approx([psi.fixed_point().gamma], abs=1e-4)
    web = max(drawn(axes, STICK_LINE), key=len)
    assert web[1] == pytest.approx([0.8, psi(0.8)])
    steps = web[1::2]
    assert steps[1:, 0] == pytest.approx(steps[:-1, 1])
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == [
        "lowest order",
        "steeper",
    ]
    assert (axes.get_xlabel(), axes.get_ylabel()) == (r"$\gamma$", r"$\Psi(\gamma)$")


def test_phase_portrait() -> None:
    figure = plot_phase_portrait(
        SLIDER,
        {"U": (1.6, 1.9), "alpha": (1.2, 1.6)},
        V,
        cycles=[slider_cycle()],
        starts=2,
        span=1.0,
    )
    (axes,) = figure.axes
    assert legend(figure) == ["stick", "stable cycle", "stable equilibrium"]
    (curve,) = drawn(axes, BLUE)
    low, high = slider_cycle().extrema["U"]
    assert (curve[:, 0].min(), curve[:, 0].max()) == pytest.approx((low, high), abs=1e-3)
    # The border of the stick region is U = μ(α) = 2/√α.
    border = np.concatenate([p.vertices for c in axes.collections[1:2] for p in c.get_paths()])
    assert len(border) > 50
    assert border[:, 0] == pytest.approx(2 / np.sqrt(border[:, 1]), abs=1e-4)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$U$", r"$\alpha$")


def test_phase_portrait_with_inertia() -> None:
    """The block rests on the line ẋ = V, where its spring can hold it: |kx| ≤ F_s."""
    block = catalogue.belt_block()
    figure = plot_phase_portrait(block, {"x": (-2.0, 2.0), "d_x": (-1.0, 1.0)}, starts=1, span=0.5)
    (axes,) = figure.axes
    stuck = np.concatenate([p.vertices for p in axes.collections[1].get_paths()])
    assert stuck[:, 1] == pytest.approx(0.3, abs=1e-9)
    assert (stuck[:, 0].min(), stuck[:, 0].max()) == pytest.approx((-1.0, 1.0), abs=0.03)
    assert legend(figure) == ["stick", "undecided equilibrium"]  # a centre: nothing damps the slip


def test_phase_portrait_needs_a_plane() -> None:
    with pytest.raises(DeclarationError, match="no phase plane"):
        plot_phase_portrait(catalogue.rocking_toy(), {"psi": (-1.0, 1.0), "d_psi": (-1.0, 1.0)})
    with pytest.raises(DeclarationError, match="the ranges of U, alpha are missing"):
        plot_phase_portrait(SLIDER, {"U": (0.0, 1.0)})


def test_basin_map() -> None:
    found = basin(
        catalogue.rocking_toy(),
        {"psi": "-1.0:1.0:7", "d_psi": "-0.9:0.9:5"},
        initial={"x_R": 0.0},
    ).dataset
    figure = plot_basin(found)
    (axes,) = figure.axes
    assert legend(figure) == ["walking, speed 0.168 m/s", "rest"]
    (mesh,) = axes.collections
    assert np.array_equal(np.asarray(mesh.get_array()).reshape(5, 7), found["attractor"].values.T)
    assert axes.get_xlabel() == r"$\psi$  [$\mathrm{rad}$]"
    with pytest.raises(DeclarationError, match="Select two"):
        plot_basin(found.isel(psi=0))


def test_bifurcation_diagram_of_equilibria_and_cycles() -> None:
    """Subcritical: unstable cycles between the Hopf point and the fold, stick-slip above; sticking
    ones in black."""
    steady = continue_equilibrium(SLIDER, "V", (0.22, 0.228))
    cycles = continue_cycle(slider_cycle(), "V", (0.223, 0.228))
    figure = plot_branch(steady, ["U"], others=[cycles])
    (axes,) = figure.axes
    shown = legend(figure)
    assert {
        "stable equilibrium",
        "unstable equilibrium",
        "stable cycle with stick",
        "unstable cycle",
    } <= set(shown)
    assert {"Hopf", "fold", "stick onset"} <= set(shown)
    black = np.concatenate(drawn(axes, STICK_LINE, "-"))
    here = black[np.abs(black[:, 0] - V["V"]) < 1e-12, 1]
    assert sorted(here) == pytest.approx(sorted(slider_cycle().extrema["U"]), rel=1e-9)
    assert len(cycles.plot().axes) == 2


def test_eigenvalues() -> None:
    found = equilibria(SLIDER, parameters=V)
    figure = plot_eigenvalues(found)
    (axes,) = figure.axes
    values = np.concatenate(
        [np.asarray(line.get_xydata()) for line in axes.get_lines() if line.get_marker() == "o"]
    )
    assert values[:, 0] + 1j * values[:, 1] == pytest.approx(
        np.array(found.isolated[0].eigenvalues)
    )
    assert legend(figure) == ["1: block slip-, stable"]


def test_a_branch_of_gaits_shows_their_speed() -> None:
    # Where the feet are says nothing: the crawler has only them.
    branch = continue_cycle(find_cycle(catalogue.two_leg_crawler()), "D", (0.9, 1.1))
    (axes,) = branch.plot().axes
    assert axes.get_ylabel().startswith("$\\mathrm{speed}$  [")
    (line,) = axes.lines
    # A step D − 2 f₊/k in each period of the rest length.
    D, speed = line.get_xdata(), line.get_ydata()
    assert speed == pytest.approx((np.asarray(D) - 0.2) / (2.0 * np.pi), rel=1e-9)


def test_whatever_was_measured_is_drawn_in_smooth_curves() -> None:
    oscillator = catalogue.forced_oscillator(F_c=0.3)
    branch = continue_cycle(find_cycle(oscillator, parameters={"omega": 1.3}), "omega", (1.2, 1.4))
    names = ["period", "amplitude_x", "dissipated", "peak_force_friction"]
    figure = branch.plot(*names)
    labels = [axes.get_ylabel().replace("\n", " ") for axes in figure.axes]
    assert labels[0] == r"period  [$\mathrm{s}$]"
    assert labels[2] == r"energy dissipated per period  [$\mathrm{N\,m}$]"
    assert labels[3].endswith(r"[$\mathrm{N}$]")
    # Between the points, too, the period is that of the drive and the amplitude Den Hartog's.
    omega, period = (np.asarray(v) for v in figure.axes[0].get_lines()[0].get_data())
    assert len(omega) > 5 * branch.points.sizes["point"]
    assert period == pytest.approx(2.0 * np.pi / omega, rel=1e-4)
    omega, amplitude = (np.asarray(v) for v in figure.axes[1].get_lines()[0].get_data())
    closed = [den_hartog.amplitude(w, 0.3) for w in omega]
    assert amplitude == pytest.approx(closed, rel=1e-3)


def test_a_smooth_curve_passes_its_points_and_breaks_at_corners() -> None:
    x = np.linspace(0.0, 1.0, 9)
    corners = x == 0.5
    along, kinked = smooth_curve(x, np.abs(x - 0.5), corners)
    assert kinked == pytest.approx(np.abs(along - 0.5), abs=1e-12)
    s = np.linspace(-1.0, 1.0, 15)
    across, up = smooth_curve(1.0 - s**2, s, np.zeros(15))  # a fold
    assert across[::PIECES] == pytest.approx(1.0 - s**2, abs=1e-15)
    assert across == pytest.approx(1.0 - up**2, abs=1e-2)
    assert np.all(np.isfinite(smooth_curve(np.zeros(3), np.zeros(3), np.zeros(3))))
