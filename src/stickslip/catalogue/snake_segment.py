"""A segment of a snake, whose scales slide forward more easily than sideways."""

from stickslip.model.system import Condition, Contact, Inertial, Parameter, System


def snake_segment(**given: float | str) -> System:
    """Segment of a snake, pushed from side to side and turned by its neighbours, as in a wave that
    travels backward. The friction of its scales is larger sideways than backward, and larger
    backward than forward, so it moves forward, although no force pushes it in that direction.

    Friction is given in the frame of the body, which turns. The friction moment is at most
    mu_t*m*g*L/4, that of a line of length L under uniform pressure.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``L``, ``mu_f``, ``mu_b``, ``mu_t``, ``g``, ``B``, ``A``, ``f``, ``k``,
        ``c``.

    References
    ----------
    D. L. Hu, J. Nirody, T. Scott & M. J. Shelley, *The mechanics of slithering locomotion*, PNAS
    106 (2009) 10081-10085: the coefficients forward 0.11, backward 0.14 and sideways 0.20. The
    drive of a single segment was chosen for this catalogue.
    """
    sliding = "sqrt((mu_f*max(v1, 0) + mu_b*max(-v1, 0))**2 + (mu_t*v2)**2 + (mu_t*L/4*v3)**2)"
    return System(
        name="snake_segment",
        title="Segment of a snake",
        source="friction of Hu et al. 2009",
        parameters={
            "m": Parameter(0.02, "kg", "mass", "(0, inf)"),
            "L": Parameter(0.05, "m", "length", "(0, inf)"),
            "mu_f": Parameter(0.11, "1", "coefficient of friction forward", "(0, inf)"),
            "mu_b": Parameter(0.14, "1", "coefficient of friction backward", "(0, inf)"),
            "mu_t": Parameter(0.20, "1", "coefficient of friction sideways", "(0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "(0, inf)"),
            "B": Parameter(0.02, "m", "amplitude of the wave", "[0, inf)"),
            "A": Parameter(0.7, "rad", "largest heading in the wave", "[0, inf)"),
            "f": Parameter(1.0, "Hz", "frequency of the wave", "(0, inf)"),
            "k": Parameter(10.0, "N/m", "stiffness against the neighbours", "(0, inf)"),
            "c": Parameter(0.01, "N*m/rad", "stiffness against a turn", "(0, inf)"),
        },
        coordinates={
            "x": Inertial("m", "position along the body"),
            "y": Inertial("m", "position across"),
            "phi": Inertial("rad", "heading"),
        },
        kinetic="m/2*(d_x**2 + d_y**2) + m*L**2/24*d_phi**2",
        potential="k/2*(y - B*sin(2*pi*f*t))**2 + c/2*(phi - A*cos(2*pi*f*t))**2",
        contacts={
            "scales": Contact(
                ("cos(phi)*d_x + sin(phi)*d_y", "cos(phi)*d_y - sin(phi)*d_x", "d_phi"),
                "m*g",
                dissipation=sliding,
                unit="N",
            )
        },
        span=(0, 5),
        time_unit="s",
        initial={"phi": 0.7},
        translation={"x": 1},
        conditions={
            "push": Condition("k*B > mu_t*m*g", "the segment may stay at rest forever"),
        },
    ).configure(given)
