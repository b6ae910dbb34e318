"""The translator against Python: what a compiled function computes is what Python computes.

``python -m tests.translator.random_programs --count 5000`` is the long run; 150 programs are tests.
"""
