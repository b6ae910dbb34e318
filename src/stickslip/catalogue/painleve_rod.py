"""Painlevé's rod: a rigid body for which Coulomb's law may have no solution."""

from math import sin

from stickslip.model.system import Condition, Inertial, Parameter, System, Unilateral


def painleve_rod(**given: float | str) -> System:
    """A rigid slender rod whose tip slides on a rough floor: for μ > 4/3 there are angles at which
    no acceleration satisfies the law.

    A tip that slides ahead of its rod digs in: N accelerates it upwards by (1 + 3 cos² θ − 3 μ sin
    θ cos θ) N/m. Where tan θ is between (3μ ∓ √(9μ² − 16))/2 this is negative, and a slip that
    starts there, as for ``mu=1.5``, ends immediately with *no admissible acceleration*. A slip
    outside this interval reaches it only if μ > 8/√27, at the lower angle and with l θ̇² sin θ = g,
    as the normal force tends to infinity; for smaller μ the tip lifts off earlier. With the
    declared parameters the tip sticks, and the rod vaults over it. The span ends before the rod
    lies on the floor: only the tip is a contact. A start on the floor has y = l sin θ.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``l``, ``g``, ``mu``, ``e``.

    References
    ----------
    P. Painlevé, *Sur les lois du frottement de glissement*, C. R. Acad. Sci. 121 (1895), 112-115;
    F. Génot and B. Brogliato, *New results on Painlevé paradoxes*, Eur. J. Mech. A/Solids 18
    (1999), 653-677.
    """
    return System(
        name="painleve_rod",
        title="Painlevé's rod on a rough floor",
        source="Painlevé 1895; Génot and Brogliato 1999",
        parameters={
            "m": Parameter(1.0, "kg", "mass", "(0, inf)"),
            "l": Parameter(1.0, "m", "half of the length", "(0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "[0, inf)"),
            "mu": Parameter(1.0, "1", "coefficient of friction", "[0, inf)"),
            "e": Parameter(0.0, "1", "restitution", "[0, 1]"),
        },
        coordinates={
            "x": Inertial("m", "position of the centre"),
            "y": Inertial("m", "height of the centre"),
            "theta": Inertial("rad", "angle of the rod from the floor"),
        },
        kinetic="m/2*(d_x**2 + d_y**2) + m*l**2/6*d_theta**2",
        potential="m*g*y",
        contacts={
            "tip": Unilateral(
                "y - l*sin(theta)",
                "d_x + l*sin(theta)*d_theta",
                "mu",
                restitution="e",
                unit="N",
            )
        },
        translation={"x": 1},
        initial={"y": sin(1.0), "theta": 1.0, "d_x": -4.0},
        span=(0, 0.95),
        time_unit="s",
        conditions={
            "no paradox": Condition(
                "mu < 4/3", "at some angles a sliding tip has no admissible acceleration"
            )
        },
        facts={
            "critical_mu": "4/3",
            "theta_1": "atan((3*mu - sqrt(max(9*mu**2 - 16, 0)))/2)",
            "theta_2": "atan((3*mu + sqrt(max(9*mu**2 - 16, 0)))/2)",
        },
    ).configure(given)
