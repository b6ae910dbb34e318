"""Friction laws fitted to points of force against speed."""
