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
SUM_ROUNDING = 8 * EPSILON  # of a short sum, in parts of its terms. For residuals of equations
INSTANT = 32 * EPSILON  # of a time, which is a sum of steps. For times too close to be told apart
ROUNDING = 64 * EPSILON  # of a Taylor coefficient, in parts of its terms. For every zero of a step
LAST_DIGITS = 1e-15  # a few units of the last digit, which no iteration can improve. For their ends
CLOSEST = 1e-15  # relative difference of times that can be told apart. For orders of events
FEW_ROUNDINGS = 1e-14  # dozens of operations. For distances, slopes, times that are differences
ROUNDED_SUM = 1e-13  # hundreds of terms, in parts of these. For drifts, modes, signs of sums
LEAST_PIVOT = 1e-13  # of a row with largest entry 1, after elimination. For singular matrices
COMPUTED_ZERO = 1e-12  # sums of sums, in parts of their terms. For what is declared or reported
TINIEST = 1e-300  # absolute; its reciprocal is finite. For divisors that may be 0; see `ratio`

# -- resolution of the state: what a motion, and what is computed from it, is known to -------------
WHOLE_COUNT = 1e-12  # a quotient of times that is whole but for rounding. For numbers of steps
SHORTEST_PIECE = 1e-12  # of what is left of a step: shorter pieces would not end. For recomputation
FIRED = 1e-10  # of its size, a guard that has just fired and is zero by definition. For switches
ON_SURFACE = 1e-9  # of its terms, what has to vanish and drifts. For constraints, contacts in stick
NO_SPEED = 1e-12  # of their terms, velocities at an impact. For contacts that take part in it
IMPACT_ZERO = 1e-10  # of the largest impulse, or jump of a velocity. For modes after an impact
CREATED_ENERGY = 1e-9  # of its energy, what an impact may gain by rounding. For impact laws
BODIES_OVERLAP = 1e-12  # of the coordinates: digits of a start. For gaps that may begin negative
CONSTRAINT_KEPT = 1e-9  # of the coordinates: nine digits given by hand. For constraints at a start
SPAN_ENDS = 1e-9  # of a span, its ends given by hand. For what records and signals cover
MOMENT = 1e-9  # of a span, after which a motion has begun. For a first output of a co-simulation
NEW_DIRECTION = 1e-20  # square of what is left of a unit vector beside others. For bases of slips
INDEPENDENT = 1e-13  # the same where forces cancel first. For contacts that share a force
ZERO_EIGENVALUE = 1e-13  # real part, of the largest eigenvalue. For rigid motions and decay
LEFT_OUT = 1e-9  # of the largest eigenvalue, what eigenvectors may lack. For closed forms
NO_GROWTH = 1e-9  # real part, of the largest eigenvalue. For stability that is not decided
EXACT_RANK = 1e-12  # singular value, of the largest, of given numbers. For directions of sets
FINE_RANK = 1e-10  # the same, of rows that are computed and scaled to 1. For translations and rests
RANK = 1e-9  # the same, of derivatives along a motion. For symmetries and dimensions of sections
SYMMETRIC = 1e-10  # of its entries, digits of a file. For matrices that have to be symmetric
SAME_VALUE = 1e-9  # one number, computed in two ways. For periodic, homogeneous and equal formulas
NO_CHANGE = 1e-9  # of the terms of a change. For symmetries, and for clocks that stand still
MAKES_UP = 1e-9  # of the terms of a line. For shifts that a period of the drives makes up for
NEARLY_WHOLE = 1e-10  # absolute, of reduced rows. For shifts with whole components
TANGENT = 1e-9  # of its terms, the speed of a guard. For events that are touched, not crossed
GUARD_TOUCHED = 1e-9  # of its size, how far from zero a guard may turn. For motions that touch it
GUARD_MARGIN = 1e-12  # of its terms, what a guard keeps at least. For proofs of rest
EXTREMUM_KNOWN = 1e-9  # of a bracket: values feel its square. For extrema on a step or a flight

# -- limits of residuals: from where on something counts as solved, or as certified ----------------
LEAST_RTOL = 1e-13  # local errors, a thousandth of it, end at rounding. For `rtol` of motions
CERTIFIED = 1e-9  # what residuals of a correct result keep below with ease. For certificates
ENERGY_SCALE = 1e-6  # of the energy: the scale of a balance if less flows. For energy residuals
FEASIBLE = 1e-10  # the least that HiGHS takes. For linear programs
NEARLY_SOLVED = 1e-8  # of its terms, about √ε: Newton converges from there. For zeros that count
LOWERED = 1e-4  # of the slope (Armijo's constant). For steps of damped Newton methods
HARMONICS_KNOWN = 1e-9  # of the largest value. For harmonics of cycles

# -- patience: how often something is tried before it is given up ----------------------------------
NEWTON_TURNS = 40  # quadratic convergence takes six; what needs more cycles. For onsets of slips
HALVINGS = 60  # 2⁻⁶⁰ of a step is below its rounding. For zeros that are bracketed
BRACKET_LOOKS = 100  # twice the bits of a number. For changes along branches
