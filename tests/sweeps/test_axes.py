"""Axes: the language, the values, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import qmc

import stickslip as ss
from stickslip.errors import DeclarationError
from stickslip.sweeps.request.axes import Axis, make_grid, read_axes

TOY = ss.catalogue.rocking_toy()


def test_ranges_and_lists() -> None:
    linear, logarithmic, some = read_axes(
        TOY, ["P=0.8:1.6:5", "delta=log:0.01:0.16:5", "psi=1/2,0.25,2"]
    )
    np.testing.assert_allclose(linear.values[0], [0.8, 1.0, 1.2, 1.4, 1.6], rtol=1e-15)
    np.testing.assert_allclose(logarithmic.values[0], [0.01, 0.02, 0.04, 0.08, 0.16], rtol=1e-14)
    assert some.values[0].tolist() == [0.5, 0.25, 2.0]
    assert [axis.spacing for axis in (linear, logarithmic, some)] == ["linear", "log", "list"]
    assert linear.ordered
    assert not some.ordered


def test_tied_parameters_move_together() -> None:
    (axis,) = read_axes(TOY, {"P,H_star": "1:2:3; 3,4,6"})
    assert axis.dimension == "P_H_star"
    assert axis.values.tolist() == [[1.0, 1.5, 2.0], [3.0, 4.0, 6.0]]
    (both,) = read_axes(TOY, {"P,H_star": "1:2:3"})
    assert both.values.tolist() == [[1.0, 1.5, 2.0]] * 2


def test_arrays() -> None:
    (axis,) = read_axes(TOY, {"P": np.array([1.0, 2.0])})
    assert axis.values.tolist() == [[1.0, 2.0]]
    (tied,) = read_axes(TOY, {"P,rho": [[1.0, 2.0], [0.1, 0.2]]})
    assert tied.values.tolist() == [[1.0, 2.0], [0.1, 0.2]]


@pytest.mark.parametrize("kind", ["sobol", "halton", "latin", "random"])
def test_samples_fill_their_box_and_repeat_with_their_seed(kind: str) -> None:
    text = f"{kind}:100; 0.8:1.6; log:0.01:0.1"
    (axis,) = read_axes(TOY, {"P,delta": text}, seed=3)
    assert len(axis) == 100
    assert axis.same_as(read_axes(TOY, {"P,delta": text}, seed=3)[0])
    assert not axis.same_as(read_axes(TOY, {"P,delta": text}, seed=4)[0])
    unit = np.column_stack([(axis.values[0] - 0.8) / 0.8, np.log10(axis.values[1]) + 2.0])
    assert np.all((unit >= -1e-12) & (unit <= 1.0 + 1e-12))
    # Even ones are several times as even as random ones, whose discrepancy is about 5e-3 here.
    assert qmc.discrepancy(np.clip(unit, 0.0, 1.0)) < (2e-2 if kind == "random" else 1e-3)


def test_latin_hypercube_has_one_point_in_each_row() -> None:
    (axis,) = read_axes(TOY, {"P,delta": "latin:20; 0:1; 0:1"})
    for column in axis.values:
        assert sorted(np.floor(20 * column)) == list(range(20))


@pytest.mark.parametrize(
    ("over", "said"),
    [
        ([], "no axis was given"),
        (["P"], "NAME=VALUES"),
        (["P=0:1:0"], "not a number of points"),
        (["P=0:1:-3"], "not a number of points"),
        (["P=0:1:1000000000000000"], "not a number of points"),
        (["P=0:1:1"], "a range needs more than one value"),
        (["P=-0.1:1:5"], "outside the admissible range"),
        (["P=1:inf:5"], "not a number"),
        (["I_b=0:1:5"], "outside the admissible range"),
        (["delta=log:0:1:5"], "logarithmic"),
        (["Q=0:1:5"], "unknown parameter or part of the state"),
        (["P=0:1:5", "P=1,2"], "given twice"),
        (["P=0:1:5", "P,delta=1:2:3"], "two axes"),
        (["P,delta=1:2:3; 1:2:4"], "vary together"),
        (["P,delta=1,2;1,2;1,2"], "2 names, but 3 lists"),
        (["P=1,1"], "occurs twice"),
        (["P=1,x"], "'x' is not a number"),
        (["P=__import__('os')"], "is not a number"),
        (["P=sobol:8"], "bounds"),
        (["P=sobol:8; 0:1:5"], "too many numbers"),
        (["P=0:1:100000", "delta=0:1:100000"], "points"),
        ({"P": []}, "no points"),
        ({"P": [np.nan]}, "finite"),
        ({"P": ["a"]}, "not numbers"),
        ({"P": [[1.0], [2.0]]}, "1 names"),
    ],
)
def test_refused(over: object, said: str) -> None:
    with pytest.raises(DeclarationError, match=said):
        read_axes(TOY, over)  # type: ignore[arg-type]


def test_indefinite_mass_is_found_before_anything_is_computed() -> None:
    system = ss.System(
        "coupled",
        parameters={"c": ss.Parameter(0.1)},
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="d_x**2/2 + d_y**2/2 + c*d_x*d_y",
    )
    with pytest.raises(DeclarationError, match="positive definite"):
        read_axes(system, {"c": "0:2:5"})


@given(st.integers(2, 40), st.integers(2, 5), st.floats(-1e6, 1e6), st.floats(1e-3, 1e6))
@settings(max_examples=60, deadline=None)
def test_a_refined_axis_holds_the_values_of_the_coarse_one(
    n: int, factor: int, low: float, width: float
) -> None:
    coarse = Axis(("P",), np.linspace(low, low + width, n)[None], "linear")
    fine = Axis(("P",), np.linspace(low, low + width, factor * (n - 1) + 1)[None], "linear")
    assert fine.positions(coarse).tolist() == list(range(0, factor * (n - 1) + 1, factor))


@given(st.lists(st.integers(1, 40), min_size=1, max_size=3))
@settings(max_examples=40, deadline=None)
def test_chunks_divide_the_grid(counts: list[int]) -> None:
    names = ("P", "delta", "rho")
    axes = [
        Axis((n,), np.arange(1.0, k + 1.0)[None], "list")
        for n, k in zip(names, counts, strict=False)
    ]
    grid = make_grid(axes)
    seen = np.zeros(grid.shape, int)
    for chunk in grid.chunks():
        region = grid.region(chunk)
        seen[region] += 1
        columns = grid.columns(region, np.arange(seen[region].size))
        expected = np.meshgrid(
            *(axis.values[0, part] for axis, part in zip(axes, region, strict=True)), indexing="ij"
        )
        for axis, values in zip(axes, expected, strict=True):
            assert columns[axis.names[0]].tolist() == values.reshape(-1).tolist()
    assert np.all(seen == 1)
