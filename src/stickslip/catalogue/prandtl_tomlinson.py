"""The Prandtl-Tomlinson model."""

from stickslip.model.system import Condition, DefaultSpan, Parameter, System, Viscous


def prandtl_tomlinson(**given: float | str) -> System:
    """A tip pulled across an atomic lattice: stick-slip from smooth forces and a small viscosity.

    Without inertia, η ẋ + (2πV_0/a) sin(2πx/a) + k(x − X(t)) = 0. The tip has no dry friction; the
    friction of the system arises because the tip jumps from one valley of the lattice to the next.

    Parameters
    ----------
    **given : float or str
        Parameters ``k``, ``V_0``, ``a``, ``nu``, ``V``; free function ``X`` (position of the
        support, of t).

    References
    ----------
    L. Prandtl, *Ein Gedankenmodell zur kinetischen Theorie der festen Körper*, ZAMM 8 (1928)
    85-106; V. L. Popov and J. A. T. Gray, *Prandtl-Tomlinson model: history and applications in
    friction, plasticity, and nanotechnologies*, ZAMM 92 (2012) 683-708. If the pull is slow, the
    spring force grows up to 2πV_0/a. If the ratio η = 4π²V_0/(ka²) exceeds 1, the tip jumps,
    shortly after, from the force (2πV_0/a)√(1 − η⁻²); otherwise it follows without jumps (the fact
    ``force_at_jump`` is 0).
    """
    return System(
        name="prandtl_tomlinson",
        title="Prandtl-Tomlinson model of a tip on a lattice",
        source="Prandtl 1928; Popov and Gray 2012",
        parameters={
            "k": Parameter(1.0, "N/m", "stiffness of the spring", "(0, inf)"),
            "V_0": Parameter(0.05, "aJ", "half the depth of the valleys", "[0, inf)"),
            "a": Parameter(0.5, "nm", "distance between the valleys", "(0, inf)"),
            "nu": Parameter(0.01, "N*s/m", "viscosity", "(0, inf)"),
            "V": Parameter(1.0, "nm/s", "speed of the support"),
        },
        functions={"eta": "4*pi**2*V_0/(k*a**2)"},
        drives={"X": "V*t"},
        coordinates={"x": Viscous("nm", "position of the tip")},
        potential="k/2*(x - X)**2 - V_0*cos(2*pi*x/a)",
        viscous="nu/2*d_x**2",
        span=DefaultSpan((0, 4)),
        time_unit="s",
        conditions={"jumps": Condition("eta > 1", "the tip follows its support without jumps")},
        facts={
            "eta": "eta",
            "largest_force": "2*pi*V_0/a",
            "force_at_jump": "sqrt(max((2*pi*V_0/a)**2 - (k*a/(2*pi))**2, 0))",
        },
    ).configure(given)
