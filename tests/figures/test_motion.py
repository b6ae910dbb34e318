"""The overview of a motion: which panels it has, what they say, and that it touches nothing
global."""

from __future__ import annotations

import io
import subprocess
import sys
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.legend import Legend

import stickslip as ss
from stickslip.figures.drawing.style import LINES, axis_label, line_colours, symbol
from stickslip.model.quantities import contact_key


def overview(
    system: ss.System, end: float | None = None, **more: Any
) -> tuple[ss.Trajectory, Figure, list[Axes]]:
    span = (system.span[0], system.span[1] if end is None else end)
    trajectory = ss.simulate(system, span, **more)
    figure = trajectory.plot()
    return trajectory, figure, [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]


def labels(panels: list[Axes]) -> list[str]:
    return [axes.get_ylabel() for axes in panels]


def legend(axes: Axes) -> list[str]:
    shown = [
        axes.get_legend(),
        *(child for child in axes.artists if isinstance(child, Legend)),
    ]
    return [text.get_text() for part in shown if part is not None for text in part.get_texts()]


def test_rocking_toy_has_traces_forces_and_two_planes() -> None:
    _, figure, panels = overview(ss.catalogue.rocking_toy(), 20.0)
    assert labels(panels)[:4] == [
        r"$\psi$  [$\mathrm{rad}$]",
        r"$x_{R}$, $x_{L}$  [$\mathrm{m}$]",
        r"$\dot{\psi}$  [$\mathrm{rad/s}$]",
        r"$\lambda$  [$\mathrm{N}$]",
    ]
    assert [axes.get_title(loc="left") for axes in panels[3:5]] == ["right leg", "left leg"]
    assert panels[4].get_xlabel() == r"time $t$  [$\mathrm{s}$]"
    assert [(axes.get_xlabel(), axes.get_ylabel()) for axes in panels[5:]] == [
        (r"$\psi$  [$\mathrm{rad}$]", r"$\dot{\psi}$  [$\mathrm{rad/s}$]"),
        (r"$\psi$  [$\mathrm{rad}$]", r"$x_{R} - x_{L}$  [$\mathrm{m}$]"),
    ]
    assert figure.get_suptitle() == "Rocking toy animal without translational inertia"
    assert "every contact sticks" in legend(panels[0])
    assert legend(panels[5]) == ["slip", "all stick", "start"]


def test_spring_slider_shows_the_state_plane() -> None:
    _, _, panels = overview(ss.catalogue.spring_slider(), 20.0)
    assert (panels[-1].get_xlabel(), panels[-1].get_ylabel()) == ("$U$", r"$\alpha$")
    assert legend(panels[-1]) == ["slip", "stick", "start"]


def test_internal_variables_alone() -> None:
    _, _, panels = overview(ss.catalogue.scaled_slider_limit(), 20.0)
    assert labels(panels) == [r"$\beta$", r"$\gamma$", r"$\gamma$"]
    assert legend(panels[-1]) == ["start"]


def test_long_names_that_begin_alike_share_a_label() -> None:
    _, _, panels = overview(ss.catalogue.bladed_disk(), 0.02)
    assert labels(panels)[0].startswith("$u$ ")
    assert labels(panels)[1].startswith(r"$r_{\mathrm{damper}}$ ")


def test_a_long_chain_becomes_maps() -> None:
    trajectory, figure, panels = overview(ss.catalogue.block_chain(N=8), 20.0)
    assert len(panels) == 3
    assert labels(panels)[0] == r"$x_{1}$ $\ldots$ $x_{8}$  [$\mathrm{m}$]"
    assert len(panels[0].get_lines()) == 8
    assert len(panels[1].images) == 1
    assert [tick.get_text() for tick in panels[2].get_yticklabels()] == list(
        trajectory.system.contacts
    )
    assert legend(panels[2]) == ["stick", "slip +", "slip −"]
    assert figure.get_size_inches()[1] < 8.0


def test_what_only_moves_on_has_no_phase_plane() -> None:
    _, _, panels = overview(ss.catalogue.two_leg_crawler(), 20.0)
    assert len(panels) == 3  # both legs, and a force for each


def test_shading_is_where_the_contact_sticks() -> None:
    trajectory, _, panels = overview(ss.catalogue.belt_block(), 30.0)
    key = contact_key("belt contact")
    for axes in panels[:3]:
        shade = min(
            (c for c in axes.collections if isinstance(c, PolyCollection)),
            key=lambda c: c.get_zorder(),
        )
        corners = [np.asarray(path.vertices)[:, 0] for path in shade.get_paths()]
        spans = [(x.min(), x.max()) for x in corners]
        assert len(spans) > 2
        for start, end in spans:
            inside = np.linspace(start, end, 9)[1:-1]
            assert np.all(trajectory.at(inside)[f"mode_{key}"] == 0)
        sticking = sum(end - start for start, end in spans)
        modes = trajectory.at(np.linspace(0.0, 30.0, 20001))[f"mode_{key}"]
        assert sticking == pytest.approx(30.0 * np.mean(modes == 0), abs=0.02)


def test_the_force_stays_in_its_band() -> None:
    _, _, panels = overview(ss.catalogue.oscillating_play(), 2.0)
    low, high, force = (np.asarray(line.get_ydata()) for line in panels[-1].get_lines())
    assert np.all(force >= low - 1e-9)
    assert np.all(force <= high + 1e-9)


@pytest.mark.parametrize(
    ("potential", "end"),
    [("-2*t*x", 2.0), ("x**2/2", 1.0)],
    ids=["stops early at a jump", "nothing happens"],
)
def test_short_and_dull_motions_have_a_picture(potential: str, end: float) -> None:
    system = ss.System(
        name="short",
        coordinates={"x": ss.RateIndependent()},
        potential=potential,
        contacts={"c": ss.Contact("d_x", "1")},
    )
    _, figure, _ = overview(system, end)
    figure.savefig(io.BytesIO(), format="png")


def test_an_immediate_end_has_a_picture() -> None:
    trajectory, figure, _ = overview(ss.catalogue.belt_block(), 30.0, max_events=1)
    assert trajectory.outcome is ss.Outcome.EVENT_LIMIT
    figure.savefig(io.BytesIO(), format="png")


def test_global_settings_stay_as_they_are() -> None:
    before = dict(mpl.rcParams)
    overview(ss.catalogue.belt_block(), 5.0)
    assert dict(mpl.rcParams) == before


def test_no_window_system_is_touched() -> None:
    script = (
        "import sys, stickslip as ss\n"
        "ss.simulate(ss.catalogue.belt_block(), (0, 5)).plot()\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


def test_labels_and_colours() -> None:
    assert symbol("d_x_R") == r"$\dot{x}_{R}$"
    assert axis_label(["U"], "1") == "$U$"
    assert line_colours(3) == list(LINES[:3])
    assert len(set(line_colours(20))) == 20
    assert contact_key("leg 1, left") == "leg_1__left"


def test_a_window_and_chosen_coordinates() -> None:
    """The part of the motion that was asked for is the same; nothing else is drawn."""
    motion = ss.simulate(ss.catalogue.rocking_toy(P=1.2), (0.0, 60.0))
    figure = motion.plot(t=(20.25, 31.5), coordinates=["psi"])
    first = figure.axes[0]
    assert first.get_xlim() == (20.25, 31.5)
    t, psi = (np.asarray(values) for values in first.get_lines()[0].get_data())
    assert (t[0], t[-1]) == (20.25, 31.5)
    assert psi == pytest.approx(motion.at(t)["psi"], abs=1e-9)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert any("psi" in label for label in labels) and not any("x_" in label for label in labels)
    (axes,) = motion.plot("x_R", t=(20.0, 30.0)).axes
    (line,) = axes.get_lines()
    seen = np.asarray(line.get_xdata())
    assert np.min(seen) >= 20.0 and np.max(seen) <= 30.0 and len(seen) > 100


def test_what_is_no_window_is_refused() -> None:
    motion = ss.simulate(ss.catalogue.belt_block(), (0.0, 10.0))
    for window in ((5.0, 5.0), (-1.0, 3.0), (2.0, 11.0)):
        with pytest.raises(ss.DeclarationError, match="is not a part of the computed time span"):
            motion.plot(t=window)
    with pytest.raises(ss.DeclarationError, match="coordinates: unknown quantity 'y'"):
        motion.plot(coordinates=["y"])
    with pytest.raises(ss.DeclarationError, match="coordinates: the list is empty"):
        motion.plot(coordinates=[])


def test_a_long_motion_is_an_envelope() -> None:
    motion = ss.simulate(ss.catalogue.forced_oscillator(), (0.0, 4e4))
    first = motion.plot().axes[0]
    below, above = first.get_lines()
    late = np.asarray(below.get_xdata()) > 1e3
    turns = motion.knots.state[motion.knots.time > 1e3, 0]
    assert np.asarray(above.get_ydata())[late].max() == pytest.approx(turns.max(), abs=1e-9)
    assert np.asarray(below.get_ydata())[late].min() == pytest.approx(turns.min(), abs=1e-9)
    # Beside it is no block of lines.
    assert len(np.asarray(above.get_xdata())) == 2000
