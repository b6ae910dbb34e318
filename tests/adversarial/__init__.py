"""The adversary: random systems of many families, judged by computations that share no code with
the library.

``python -m tests.adversarial --count 20000`` is the long run; a few dozen cases of each kind are
tests.
"""
