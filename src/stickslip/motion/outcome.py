"""How a computation ended."""

from __future__ import annotations

from stickslip.results import Ended


class Outcome(Ended):
    """How a motion ended; ``message`` says what it means and what to do.

    Everything computed up to there is kept in the result.
    """

    FINISHED = (0, "finished", "The end of the time span was reached")
    AT_REST = (
        1,
        "at rest forever",
        "No later event is possible: every contact sticks and the rest converges",
    )
    NO_BOUNDED_RATE = (
        2,
        "no bounded rate",
        "The forces cannot be balanced at any finite rate: the system jumps. "
        "Give the coordinate viscosity or mass, or lower the load",
    )
    SLIDING_ON_A_JUMP = (
        3,
        "sliding on a jump",
        "A piecewise function that jumps pushes the motion onto its jump from both "
        "sides. Make the function continuous, or model the jump as a contact",
    )
    ZENO = (4, "event accumulation", "Infinitely many events pile up at this time (Zeno)")
    STEP_TOO_SMALL = (
        5,
        "step too small",
        "The motion blows up or the formulas are singular near this time",
    )
    EVENT_LIMIT = (6, "limit on events reached", "Raise max_events to go on")
    NEGATIVE_THRESHOLD = (
        7,
        "threshold negative",
        "A threshold became negative; write max(..., 0) where it may vanish",
    )
    UNDEFINED = (
        8,
        "undefined",
        "A formula has no finite value here (log or sqrt of a negative number, asin beyond 1, "
        "overflow)",
    )
    OUTSIDE_TABLE = (
        24,
        "outside of a table",
        "A table has no values beyond its ends. Measure further, or say what it is there: "
        'outside = "constant" or "linear"',
    )
    TIME_UP = (
        23,
        "time limit reached",
        "The time limit was reached; what was computed is kept. Raise time_limit to continue",
    )
    INTERRUPTED = (9, "interrupted", "Stopped by the user; what was computed is kept")
    PERIODIC = (10, "periodic", "The motion has settled on a cycle")
    STEADY = (11, "steady", "The motion has settled on steady sliding or another equilibrium")
    NOT_SETTLED = (
        12,
        "not settled",
        "The limits were reached before the motion repeated itself: it is not periodic, it repeats "
        "too late (a cycle of more events than are compared), or it nears its cycle too slowly. "
        "Raise max_time, max_cycles or longest_cycle. Rest that cannot be proved, and a load that "
        "does not repeat, have not settled either",
    )
    UNDAMPED = (
        13,
        "undamped",
        "The motion goes on without events for ever, and an oscillation in it neither dies out nor "
        "grows: nothing damps it. Add damping",
    )
    NO_INERTIA = (
        16,
        "inertia not positive definite",
        "The mass matrix is not positive definite here: some motion would have no, or negative, "
        "kinetic energy. Check the kinetic energy, or end the motion before",
    )
    NO_ACCELERATION = (
        17,
        "no admissible acceleration (Painlevé)",
        "No mode of the contacts has accelerations that obey Coulomb's law with these normal "
        "forces: only an impulse could go on. Lower the coefficient of friction",
    )
    NO_MODE = (
        22,
        "no admissible mode",
        "No mode of the contacts goes on from here; the reason is not known. It is not Painlevé's "
        "paradox: friction changes the normal forces too little for that, if at all. At the start "
        "of a motion, or after a jump of the state, look for bodies that overlap; elsewhere for "
        "forces so stiff that rounding decides",
    )
    NO_COLLISION = (
        18,
        "no admissible impact",
        "No impulses were found that obey the law of impacts. Where bodies touch at more places "
        "than they can move, restitution has to be the same at all of them, or zero; or let the "
        "impacts come in turn",
    )
    CREATES_ENERGY = (
        19,
        "impact that creates energy",
        "Newton's law of impacts with friction would create energy here. Lower the restitution or "
        "the coefficient of friction",
    )
    JUMPS_MEET = (
        20,
        "several jumps at once",
        "The guards of two jumps pass through zero at the same time, so that the state jumps in no "
        "order. Declare one jump that does what both do, or move one of the guards. Of two "
        "sampling periods write one as a multiple of the other, such as 10*T",
    )
    JUMPS_ON = (
        21,
        "a jump ends in the guard of a jump",
        "The state has jumped to where a jump fires at once, its own or another one: there may be "
        "no end of it. Let it jump to one side of the guard, or give the guard a direction",
    )
    OUTSIDE = (
        15,
        "outside the stable set",
        "The initial state violates |∂Φ| ≤ s: friction cannot hold it, so that no motion starts "
        "there. Start inside the stable set; the excess says by how much the force is too large",
    )

    INADMISSIBLE_KINETIC = (
        14,
        "kinetic force not admissible",
        "The sliding force of a contact became negative, or larger than its threshold at the onset "
        "of slip. Keep 0 <= kinetic, and kinetic <= threshold at speed 0",
    )

    @property
    def ok(self) -> bool:
        """Whether what was asked for was computed: the whole time span, or what the motion settles
        on."""
        return self in (Outcome.FINISHED, Outcome.AT_REST, Outcome.PERIODIC, Outcome.STEADY)
