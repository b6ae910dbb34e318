"""Levels: the numbers at which a computation decides that something is zero, equal, known, solved,
or not worth another try, where several modules have to decide alike.

Each line gives the reason, then, after "For", what depends on it. A level that only one module uses
is a constant of that module, with its reason there. All levels are relative to the size that their
line names, unless it says otherwise.
"""

from __future__ import annotations

# -- rounding: what floating-point arithmetic leaves of zero ---------------------------------------
EPSILON = 2.220446049250313e-16  # spacing of numbers at 1. For bounds of rounding that count terms
ONE_ULP = 2.3e-16  # just above ε: neighbouring numbers. For ends of iterations, times of samples
ROUNDED_TERM = 4e-16  # less than two roundings. For errors that are bounded term by term
SUM_ROUNDING = 8 * EPSILON  # error of a short sum relative to its terms. For residuals of equations
INSTANT = 32 * EPSILON  # error of a time, a sum of steps. For times too close to be distinguished
ROUNDING = 64 * EPSILON  # error of a Taylor coefficient, relative to its terms. For zeros of a step
LAST_DIGITS = 1e-15  # a few units of the last digit, which no iteration improves. For their ends
CLOSEST = 1e-15  # relative difference of times that can be distinguished. For orders of events
FEW_ROUNDINGS = 1e-14  # dozens of operations. For distances, slopes, times that are differences
ROUNDED_SUM = 1e-13  # hundreds of terms, relative to these. For drifts, modes, signs of sums
LEAST_PIVOT = 1e-13  # after elimination, in a row with largest entry 1. For singular matrices
COMPUTED_ZERO = 1e-12  # sums of sums, relative to their terms. For declared or reported quantities
TINIEST = 1e-300  # absolute; its reciprocal is finite. For divisors that may be 0; see `ratio`

# -- resolution of the state: what a motion, and what is computed from it, is known to -------------
WHOLE_COUNT = 1e-12  # a quotient of times that is an integer up to rounding. For numbers of steps
SHORTEST_PIECE = 1e-12  # fraction of a remaining step. For recomputation, which has to end
FIRED = 1e-10  # a guard that has just fired, relative to its size: zero by definition. For switches
ON_SURFACE = 1e-9  # drift relative to the terms of a constraint. For constraints, contacts in stick
NO_SPEED = 1e-12  # velocities, relative to their terms. For contacts that take part in an impact
IMPACT_ZERO = 1e-10  # relative to the largest impulse or jump. For modes after an impact
CREATED_ENERGY = 1e-9  # relative energy that an impact may gain by rounding. For impact laws
BODIES_OVERLAP = 1e-12  # relative to the coordinates of a start. For gaps that may begin negative
CONSTRAINT_KEPT = 1e-9  # relative to the coordinates: nine digits. For constraints at a start
SPAN_ENDS = 1e-9  # fraction of a span, with ends given by hand. For coverage of records and signals
MOMENT = 1e-9  # fraction of a span, its very beginning. For a first output of a co-simulation
NEW_DIRECTION = 1e-20  # squared remainder of a unit vector after projection. For bases of slips
INDEPENDENT = 1e-13  # the same if forces cancel first. For contacts that share a force
ZERO_EIGENVALUE = 1e-13  # real part relative to the largest eigenvalue. For rigid motions and decay
LEFT_OUT = 1e-9  # part without eigenvectors, relative to the largest eigenvalue. For closed forms
NO_GROWTH = 1e-9  # real part relative to the largest eigenvalue. For stability that is not decided
EXACT_RANK = 1e-12  # singular value by the largest, for given numbers. For directions of sets
FINE_RANK = 1e-10  # the same for rows that are computed and scaled to 1. For translations and rests
RANK = 1e-9  # the same for derivatives along a motion. For symmetries and dimensions of sections
SYMMETRIC = 1e-10  # digits of the entries in a file. For matrices that have to be symmetric
SAME_VALUE = 1e-9  # one number, computed in two ways. For periodic, homogeneous and equal formulas
NO_CHANGE = 1e-9  # relative to its terms. For symmetries, and for clocks that stand still
MAKES_UP = 1e-9  # relative to its terms. For shifts that compensate a period of the drives
NEARLY_WHOLE = 1e-10  # absolute, of reduced rows. For shifts with whole components
TANGENT = 1e-9  # speed of a guard relative to its terms. For events that are touched, not crossed
GUARD_TOUCHED = 1e-9  # minimum of a guard relative to its size. For motions that touch it
GUARD_MARGIN = 1e-12  # smallest guard relative to its terms. For proofs of rest
EXTREMUM_KNOWN = 1e-9  # relative to a bracket; values change by its square. For extrema on a step

# -- limits of residuals: from where on something counts as solved, or as certified ----------------
LEAST_RTOL = 1e-13  # local errors, a thousandth of it, end at rounding. For `rtol` of motions
CERTIFIED = 1e-9  # limit that residuals of a correct result keep with a margin. For certificates
ENERGY_SCALE = 1e-6  # fraction of the energy, if less flows. For the scale of energy residuals
FEASIBLE = 1e-10  # smallest tolerance of HiGHS. For linear programs
NEARLY_SOLVED = 1e-8  # relative to its terms, about √ε: Newton converges. For zeros that count
LOWERED = 1e-4  # fraction of the slope (Armijo's constant). For steps of damped Newton methods
HARMONICS_KNOWN = 1e-9  # relative to the largest value. For harmonics of cycles

# -- patience: how often something is tried before it is given up ----------------------------------
NEWTON_TURNS = 40  # quadratic convergence takes six; more is a cycle. For onsets of slips
HALVINGS = 60  # 2⁻⁶⁰ of a step is below its rounding. For zeros that are bracketed
BRACKET_LOOKS = 100  # twice the bits of a number. For changes along branches
