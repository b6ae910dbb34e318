"""An oscillator in a plane with a dry damper behind springs."""

from stickslip.model.system import Condition, Contact, Inertial, Parameter, RateIndependent, System


def planar_jenkins(**given: float | str) -> System:
    """Mass on springs under a force that moves along an ellipse, damped by a slider behind a
    spring; the slider slips in the direction of its force, which may be any.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``c``, ``k``, ``k_d``, ``F_c``, ``P``, ``Q``, ``omega``.

    References
    ----------
    C.-H. Menq, P. Chidamparam, J. H. Griffin, *Friction damping of two-dimensional motion and its
    application in vibration control*, J. Sound Vib. 144 (1991) 427-447; K. Y. Sanliturk, D. J.
    Ewins, *Modelling two-dimensional friction contact and its application using harmonic balance
    method*, J. Sound Vib. 193 (1996) 511-523. Where the force goes around a circle (``Q`` = ``P``),
    both the mass and the slider move on circles, the slider at a right angle behind its force: its
    radius B solves ((k − mω²)² + (cω)²) B² + 2cωF_c B + (cωF_c/k_d)² + ((k − mω²)F_c/k_d + F_c)² =
    P², and that of the mass is √(B² + (F_c/k_d)²).
    """
    return System(
        name="planar_jenkins",
        title="Oscillator in a plane with a dry damper",
        source="Menq, Chidamparam, Griffin 1991; Sanliturk, Ewins 1996",
        parameters={
            "m": Parameter(1.0, "kg", "mass", "(0, inf)"),
            "c": Parameter(0.1, "N*s/m", "viscous damping", "[0, inf)"),
            "k": Parameter(1.0, "N/m", "stiffness", "(0, inf)"),
            "k_d": Parameter(1.0, "N/m", "stiffness of the damper", "(0, inf)"),
            "F_c": Parameter(0.5, "N", "force at which the damper slides", "(0, inf)"),
            "P": Parameter(0.8, "N", "amplitude of the force along x", "(0, inf)"),
            "Q": Parameter(0.4, "N", "amplitude of the force along y", "[0, inf)"),
            "omega": Parameter(1.2, "rad/s", "angular frequency of the force", "(0, inf)"),
        },
        functions={
            "K": "k - m*omega**2",
            "D": "c*omega",
            "Z": "K**2 + D**2",
            "W": "P**2 - (D*F_c/k_d)**2 - (K*F_c/k_d + F_c)**2",
            "B": "(sqrt((D*F_c)**2 + Z*W) - D*F_c)/Z",
        },
        coordinates={
            "x": Inertial("m", "position of the mass", force="P*cos(omega*t)"),
            "y": Inertial("m", "position across", force="Q*sin(omega*t)"),
            "z_x": RateIndependent("m", "position of the slider"),
            "z_y": RateIndependent("m", "position of the slider along y"),
        },
        kinetic="m/2*(d_x**2 + d_y**2)",
        potential="k/2*(x**2 + y**2) + k_d/2*((x - z_x)**2 + (y - z_y)**2)",
        viscous="c/2*(d_x**2 + d_y**2)",
        contacts={"damper": Contact(("d_z_x", "d_z_y"), threshold="F_c", unit="N")},
        span=(0, 80),
        time_unit="s",
        conditions={"slip": Condition("W > 0", "the damper does not slide on a circle")},
        facts={"circle": "sqrt(B**2 + (F_c/k_d)**2)", "circle_of_slider": "B"},
    ).configure(given)
