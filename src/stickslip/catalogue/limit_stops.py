"""A forced mass with dry friction between two stops."""

from math import pi

from stickslip.model.system import Contact, DefaultSpan, Inertial, Parameter, System, Unilateral


def limit_stops(**given: float | str) -> System:
    """A small valve: a spool on a spring, pushed by an oscillating pressure, with dry friction and
    a stop at either end.

    The spool rebounds a few times, comes to rest at a stop, and leaves it when the force reverses.
    Event handlers that treat every transition separately easily fail at this.

    Parameters
    ----------
    **given : float or str
        Parameters ``M``, ``k``, ``F_0``, ``left``, ``right``, ``F_c``, ``e``, ``area``, ``P_0``,
        ``P_1``, ``omega``; drive ``pressure`` (of t).

    References
    ----------
    Parameters of github.com/SciML/DiffEqBase.jl, issue 634 (2021): a zero of a condition is missed
    there.
    """
    return System(
        name="limit_stops",
        title="Forced mass with dry friction between stops",
        source="SciML/DiffEqBase.jl, issue 634",
        parameters={
            "M": Parameter(0.0003361185937456267, "kg", "mass", "(0, inf)"),
            "k": Parameter(1488.578099595049, "N/m", "stiffness of the spring", "[0, inf)"),
            "F_0": Parameter(8.54503372291542, "N", "force of the spring at the left stop"),
            "left": Parameter(0.0, "m", "position of the left stop"),
            "right": Parameter(0.001016, "m", "position of the right stop"),
            "F_c": Parameter(1.0, "N", "dry friction", "[0, inf)"),
            "e": Parameter(0.3, "1", "restitution of the stops", "[0, 1]"),
            "area": Parameter(7.373657906574696e-5, "m^2", "area under pressure", "(0, inf)"),
            "P_0": Parameter(6895.0 * 18.0, "Pa", "mean pressure"),
            "P_1": Parameter(6895.0 * 4.0, "Pa", "amplitude of the pressure"),
            "omega": Parameter(500.0 * pi, "1/s", "frequency of the pressure", "(0, inf)"),
        },
        drives={"pressure": "P_0 + P_1*sin(omega*t)"},
        coordinates={"x": Inertial("m", "position of the spool", force="area*pressure")},
        kinetic="M/2*d_x**2",
        potential="F_0*x + k/2*x**2",
        contacts={
            "wall": Contact("d_x", threshold="F_c", unit="N"),
            "left stop": Unilateral("x - left", restitution="e", unit="N"),
            "right stop": Unilateral("right - x", restitution="e", unit="N"),
        },
        span=DefaultSpan((0, 0.02)),
        time_unit="s",
    ).configure(given)
