"""Friction laws beside points of force over speed."""
