"""A finite-element beam with 200 degrees of freedom and Jenkins contacts at three nodes: the
response of its tip to a force at three levels, with stability and the largest amplitude at each
level.

Prints the frequency and amplitude of each resonance, and plots the curves.
"""

import numpy as np

import stickslip as ss

LENGTH, BENDING, DENSITY = 2.0, 2.3125e6, 117.45  # m, N m², kg/m


def matrices(elements):
    """Mass and stiffness of a beam clamped at one end, deflection and rotation at each node."""
    h = LENGTH / elements
    n = 2 * elements + 2
    stiff = np.array(
        [
            [12, 6 * h, -12, 6 * h],
            [6 * h, 4 * h * h, -6 * h, 2 * h * h],
            [-12, -6 * h, 12, -6 * h],
            [6 * h, 2 * h * h, -6 * h, 4 * h * h],
        ]
    )
    heavy = np.array(
        [
            [156, 22 * h, 54, -13 * h],
            [22 * h, 4 * h * h, 13 * h, -3 * h * h],
            [54, 13 * h, 156, -22 * h],
            [-13 * h, -3 * h * h, -22 * h, 4 * h * h],
        ]
    )
    M, K = np.zeros((n, n)), np.zeros((n, n))
    for e in range(elements):
        part = slice(2 * e, 2 * e + 4)
        M[part, part] += DENSITY * h / 420 * heavy
        K[part, part] += BENDING / h**3 * stiff
    return M[2:, 2:], K[2:, 2:]


def blade(elements=100, modes=4):
    """The beam with its contacts, reduced to contacts, tip and a few fixed-interface modes."""
    M, K = matrices(elements)
    at = {f"rub{i}": 2 * (elements * part // 10 - 1) for i, part in enumerate((3, 4, 5), 1)}
    beam = ss.Structure(M, K, ss.ModalDamping(0.005), names={**at, "tip": len(M) - 2}, unit="m")
    return ss.System(
        "blade",
        parameters={
            "F": ss.Parameter(200.0, "N", "amplitude of the force at the tip"),
            "omega": ss.Parameter(120.0, "rad/s", "angular frequency of the force"),
            "F_c": ss.Parameter(100.0, "N", "force at which a contact slides"),
            "k": ss.Parameter(5e5, "N/m", "tangential stiffness of a contact"),
        },
        structures={"u": beam.reduced(keep=[*at, "tip"], modes=modes)},
        forces={"u[tip]": "F*cos(omega*t)"},
        contacts={name: ss.laws.jenkins(f"d_u[{name}]", F_c="F_c", k="k", unit="N") for name in at},
        time_unit="s",
    )


def response(system, forces=(20.0, 60.0, 200.0), points=20):
    """Amplitude of the tip over the frequency, at each level of the force."""
    return ss.frequency_response(
        system, "omega", (115.0, 135.0), levels={"F": list(forces)}, of="u[tip]", points=points
    )


if __name__ == "__main__":
    found = response(blade())
    for i, F in enumerate(found.levels):
        peak, omega = float(found["peak_amplitude"][i]), float(found["peak_omega"][i])
        print(f"{F:5.0f} N: {1e3 * peak:.3f} mm at {omega:.2f} rad/s")
    print("all stable:", bool(found["stable"].all()), " certified:", found.certificate.ok)
    found.plot().savefig("blade-response.png")
