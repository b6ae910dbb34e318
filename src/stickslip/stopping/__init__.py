"""How a computation ends before it is done: at Ctrl-C, when its time is up, or with the pool that
it works for.

Python hears of a signal between two instructions of its own, so not while a compiled loop runs.
Compiled loops therefore look at two flags in their work space, and return early once one is raised;
a thread beside them raises the flags. A motion that is not cut short does not depend on them.

Whoever computes opens a scope (:func:`~stickslip.stopping.scopes.watching`), and calls
:func:`~stickslip.stopping.scopes.heed` after each compiled call that may last: it raises what has
happened. Scopes belong to threads. What runs inside a scope ends with it.
"""
