"""Structures: bodies given by mass, damping and stiffness matrices, as from a finite-element code,
as parts of a system.

1. :class:`~stickslip.structures.structure.Structure` holds arrays, not formulas: they are checked
   once, and never change.
2. Formulas name single unknowns, ``u[3]`` or ``u[tip]``, and their rates, ``d_u[tip]``. A name in
   brackets is an :class:`~stickslip.symbolic.formulas.Indexed`, of which a scope knows the entries.
3. Indices and names are always those of the structure as it was given. One that is reduced has
   fewer coordinates and a matrix, its *basis*, by which all unknowns follow; so what is written of
   a structure stays true when it is reduced.
4. Where a system is written out (:mod:`stickslip.model.written_out`), laws come first, and push
   unknowns as they push coordinates; then the structure becomes its modes, inertial coordinates
   ``u_mode_1``, ..., with diagonal mass and stiffness (:mod:`~stickslip.structures.coordinates`).
   An unknown is a linear form of them from then on.
5. Results compute unknowns from the modes, so nothing that computes knows of structures, and what
   computes them in another way changes nothing of what is declared, or read of a result.
6. Files hold the arrays, and the modes, since these are unique up to rounding alone (up to rotation
   where frequencies coincide), and states are given in them (:mod:`~stickslip.structures.files`).
"""
