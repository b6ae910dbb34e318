"""The minimal model of mode coupling in brakes, Hoffmann et al. 2002."""

from stickslip.model import laws
from stickslip.model.system import Condition, Inertial, Parameter, System


def brake_mode_coupling(**given: float | str) -> System:
    """Mass on two oblique springs, pressed onto a belt by a third: it squeals under a constant
    friction coefficient.

    The friction is proportional to the normal force, which depends on the vertical motion, so that
    the stiffness matrix is not symmetric. Two modes coalesce and one of them grows until the mass
    sticks.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``c``, ``k_1``, ``k_2``, ``k_3``, ``alpha_1``, ``alpha_2``, ``mu``,
        ``N_0``, ``V``.

    References
    ----------
    N. Hoffmann, M. Fischer, R. Allgaier and L. Gaul, *A minimal model for studying properties of
    the mode-coupling type instability in friction induced oscillations*, Mechanics Research
    Communications 29 (2002) 197-205. Flutter begins where (k_xx − k_yy)² + 4 k_xy (k_xy − μ k_3) =
    0; damping c in both directions moves it by c²(k_xx + k_yy)/(2 m k_xy k_3).
    """
    return System(
        name="brake_mode_coupling",
        title="Mode coupling of a brake, two degrees of freedom",
        source="Hoffmann, Fischer, Allgaier and Gaul 2002",
        parameters={
            "m": Parameter(1.0, "kg", "mass", "(0, inf)"),
            "c": Parameter(0.1, "N*s/m", "damping in both directions", "[0, inf)"),
            "k_1": Parameter(11.0, "N/m", "stiffness of the first spring", "(0, inf)"),
            "k_2": Parameter(20.0, "N/m", "stiffness of the second spring", "(0, inf)"),
            "k_3": Parameter(11.0, "N/m", "stiffness of the contact", "(0, inf)"),
            "alpha_1": Parameter(150.0 * 3.141592653589793 / 180.0, "rad", "its direction"),
            "alpha_2": Parameter(30.0 * 3.141592653589793 / 180.0, "rad", "its direction"),
            "mu": Parameter(0.6, "1", "coefficient of friction", "[0, inf)"),
            "N_0": Parameter(10.0, "N", "normal force at y = 0", "(0, inf)"),
            "V": Parameter(0.1, "m/s", "speed of the belt", "(0, inf)"),
        },
        functions={
            "k_xx": "k_1*cos(alpha_1)**2 + k_2*cos(alpha_2)**2",
            "k_xy": "k_1*sin(alpha_1)*cos(alpha_1) + k_2*sin(alpha_2)*cos(alpha_2)",
            "k_yy": "k_1*sin(alpha_1)**2 + k_2*sin(alpha_2)**2 + k_3",
            "mu_0": "(k_xy**2 + (k_xx - k_yy)**2/4)/(k_xy*k_3)",
            "mu_c": "mu_0 + c**2*(k_xx + k_yy)/(2*m*k_xy*k_3)",
        },
        coordinates={
            "x": Inertial("m", "displacement along the belt"),
            "y": Inertial("m", "displacement into the belt"),
        },
        kinetic="m/2*(d_x**2 + d_y**2)",
        potential="k_xx/2*x**2 + k_xy*x*y + k_yy/2*y**2",
        viscous="c/2*(d_x**2 + d_y**2)",
        contacts={
            "belt contact": laws.coulomb(
                "d_x", surface_speed="V", unit="N", F_c="mu*max(N_0 + k_3*y, 0)"
            )
        },
        initial={"x": 0.25, "y": -0.05},
        span=(0, 60),
        time_unit="s",
        conditions={"flutter": Condition("mu > mu_c", "steady sliding is stable")},
        facts={"undamped_flutter": "mu_0", "flutter": "mu_c"},
    ).configure(given)
