"""Early ends of computations: at Ctrl-C, at a time limit, or with the pool of a worker.

Python handles signals between bytecode instructions, and thus not while a compiled loop runs.
Compiled loops therefore check two flags in their work space, which another thread sets, and return
early if one is set. They do not affect a computation that is not interrupted.

A computation opens a scope (:func:`~stickslip.stopping.scopes.watching`), and calls
:func:`~stickslip.stopping.scopes.check_stop` after each compiled call that may take long; it raises
the corresponding exception. Scopes belong to threads and may be nested; an inner scope ends with
the outer one.
"""
