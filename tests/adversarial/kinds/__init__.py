"""Kinds of cases: each draws cases, computes them twice and compares."""
