"""Effective friction: K_av = ∩ₛ K(s) and Ψ_av, [M] (2.3)."""
