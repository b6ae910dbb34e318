"""A drill string whose bit sticks and slips."""

from stickslip.model import laws
from stickslip.model.system import Condition, Inertial, Parameter, System


def drill_string(**given: float | str) -> System:
    """Torsion of a drill string between a rotary table and a bit with a Stribeck friction law.

    Angles are relative to uniform rotation, Ωt. The motor holds the table like a damper c_t and a
    spring k_t, the proportional and the integral part of its control.

    Parameters
    ----------
    **given : float or str
        Parameters ``J``, ``J_t``, ``k``, ``c``, ``c_t``, ``k_t``, ``Omega``, ``T_s``, ``T_c``,
        ``omega_s``.

    References
    ----------
    J. D. Jansen and L. van den Steen, *Active damping of self-excited torsional vibrations in oil
    well drillstrings*, J. Sound and Vibration 179 (1995) 647-668, for the model and the order of
    its inertias and stiffness. With a table at prescribed speed the bit slides uniformly above Ω_c,
    where c = ((T_s − T_c)/ω_s) exp(−Ω/ω_s).
    """
    return System(
        name="drill_string",
        title="Drill string: torsion of a bit that sticks",
        source="Jansen and van den Steen 1995",
        parameters={
            "J": Parameter(374.0, "kg*m^2", "inertia of the bit and collars", "(0, inf)"),
            "J_t": Parameter(2122.0, "kg*m^2", "inertia of the table", "(0, inf)"),
            "k": Parameter(473.0, "N*m/rad", "torsional stiffness of the pipe", "(0, inf)"),
            "c": Parameter(50.0, "N*m*s/rad", "damping at the bit", "[0, inf)"),
            "c_t": Parameter(4000.0, "N*m*s/rad", "damping by the motor", "[0, inf)"),
            "k_t": Parameter(3000.0, "N*m/rad", "integral action of the motor", "[0, inf)"),
            "Omega": Parameter(5.0, "rad/s", "speed of the table", "(0, inf)"),
            "T_s": Parameter(6000.0, "N*m", "torque at rest", "(0, inf)"),
            "T_c": Parameter(4000.0, "N*m", "torque at high speed", "(0, inf)"),
            "omega_s": Parameter(2.0, "rad/s", "speed over which friction decreases", "(0, inf)"),
        },
        coordinates={
            "theta": Inertial("rad", "angle of the table minus Ωt"),
            "phi": Inertial("rad", "angle of the bit minus Ωt"),
        },
        kinetic="J_t/2*d_theta**2 + J/2*d_phi**2",
        potential="k/2*(theta - phi)**2 + k_t/2*theta**2",
        viscous="c_t/2*d_theta**2 + c/2*d_phi**2",
        contacts={
            "bit": laws.stribeck(
                "d_phi", surface_speed="-Omega", unit="N*m", F_s="T_s", F_c="T_c", v_s="omega_s"
            )
        },
        span=(0, 60),
        time_unit="s",
        conditions={
            "falling": Condition("T_s > T_c", "the torque does not decrease with the speed")
        },
        facts={
            "critical_speed": "omega_s*log((T_s - T_c)/(c*omega_s))",
            "frequency": "sqrt(k/J)/(2*pi)",
        },
    ).configure(given)
