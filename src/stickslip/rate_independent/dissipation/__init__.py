"""Dissipation potentials: convex, 1-homogeneous, and periodic in the phase."""

from stickslip.rate_independent.dissipation.ellipsoid import Ellipsoid
from stickslip.rate_independent.dissipation.formula import SupportFormula
from stickslip.rate_independent.dissipation.group_norm import GroupNorm
from stickslip.rate_independent.dissipation.polytope import Polytope
from stickslip.rate_independent.dissipation.product import Product
from stickslip.rate_independent.dissipation.support_function import SupportFunction
from stickslip.rate_independent.dissipation.weighted_l1 import WeightedL1
from stickslip.rate_independent.sets.potential import Average, Dissipation, OptimalMotion

__all__ = [
    "Average",
    "Dissipation",
    "Ellipsoid",
    "GroupNorm",
    "OptimalMotion",
    "Polytope",
    "Product",
    "SupportFormula",
    "SupportFunction",
    "WeightedL1",
]
