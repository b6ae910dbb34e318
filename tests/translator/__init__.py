"""The translator against Python: what a compiled function computes is what Python computes of it.

``python -m tests.translator.random_programs --count 5000`` is the long run; 150 programs are a test.
"""
