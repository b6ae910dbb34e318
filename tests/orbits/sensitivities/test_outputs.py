"""Derivatives of outputs, and fits to records of them."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss

TRUE = {"k": 2.3, "mu": 0.14}


def masses() -> ss.System:
    return ss.System(
        name="masses",
        parameters={"k": ss.Parameter(2.0), "mu": ss.Parameter(0.1)},
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="d_x**2/2 + d_y**2/2",
        potential="x**2/2 + k/2*(x - y)**2",
        contacts={"rub": ss.Contact("d_y", "mu")},
        initial={"x": 1.0},
        outputs={"apart": "x - y", "spring": "k*apart", "power": "friction_rub*slip_speed_rub"},
    )


def test_derivatives_of_outputs_follow_the_chain_rule() -> None:
    motion = ss.simulate(masses(), (0.0, 6.0))
    times = np.linspace(0.5, 6.0, 12)
    found = motion.sensitivity(
        ["k", "mu", "x"], times, of=["x", "y", "apart", "spring", "power"], second_opinion=True
    )
    np.testing.assert_allclose(found["apart"], found["x"] - found["y"], atol=1e-12)
    at = motion.at(times)
    chain = 2.0 * found["apart"].values
    chain[0] += at["apart"]
    np.testing.assert_allclose(found["spring"], chain, atol=1e-12)
    for name in ("apart", "spring", "power"):
        np.testing.assert_allclose(found[name], found[f"{name}_by_differences"], atol=1e-6)
    assert found["spring"].attrs["long_name"] == "derivative of spring"


def test_a_record_of_an_output_is_fitted() -> None:
    system = masses()
    times = np.linspace(0.0, 6.0, 121)
    record = ss.simulate(system, (0.0, 6.0), parameters=TRUE).at(times)
    data = {"t": times, "apart": record["apart"]}
    found = ss.fit(system, ss.Recording(data), ["k", "mu"])
    for name, value in TRUE.items():
        assert found.parameters[name] == pytest.approx(value, rel=1e-8)
    found.plot()
    twice = ss.fit(
        system,
        ss.Recording({"t": times, "gauge": 2.0 * record["apart"]}),
        ["k"],
        observe={"gauge": "2*apart"},
        parameters={"mu": TRUE["mu"]},
    )
    assert twice.parameters["k"] == pytest.approx(TRUE["k"], rel=1e-8)


def test_kinks_of_outputs_have_no_derivative() -> None:
    from dataclasses import replace

    motion = ss.simulate(replace(masses(), outputs={"size": "abs(x)"}), (0.0, 1.0))
    with pytest.raises(ss.DeclarationError, match="kink"):
        motion.sensitivity(["k"], [0.5], of=["size"])
