"""Friction laws fitted to points of force over speed."""
