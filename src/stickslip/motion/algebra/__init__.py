"""Compiled linear algebra and polynomials: roots, orthonormal bases, eigenvalues."""
