"""A motion that dies out while it is carried on by hand comes to an end."""

from __future__ import annotations

import pytest

from stickslip import Contact, Inertial, Parameter, System
from stickslip.errors import ConvergenceError
from stickslip.orbits.cycles.find_cycle import find_cycle

STRING = System(
    "drill string of two inertias",
    parameters={
        "rpm": Parameter(180.0),
        "W": Parameter(20e3),
        "J_b": Parameter(374.0),
        "R": Parameter(0.155),
        "mu_s": Parameter(0.8),
        "mu_k": Parameter(0.5),
        "v_f": Parameter(2.0),
        "c_t": Parameter(100.0),
    },
    functions={"T(w)": "W*R/3*2*(mu_k + (mu_s - mu_k)*exp(-w/v_f))"},
    coordinates={"a1": Inertial("rad"), "a2": Inertial("rad")},
    kinetic="1500.0*d_a1**2/2 + J_b*d_a2**2/2",
    potential="946.0*a1**2/2 + 946.0*(a2 - a1)**2/2",
    viscous="c_t*d_a1**2/2 + 2.5*d_a1**2/2 + 2.5*d_a2**2/2",
    contacts={"bit": Contact("d_a2", "T(0)", "-rpm*pi/30", kinetic="T(speed)")},
    span=(0, 60),
)


def test_a_state_in_the_plane_is_no_return() -> None:
    """What is carried on starts in the plane that it was caught in, up to rounding. Here it starts
    a little below, and would be taken for its own return for ever."""
    with pytest.raises(ConvergenceError, match="comes to rest"):
        find_cycle(STRING, {"a2": -20.0})
