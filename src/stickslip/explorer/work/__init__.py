"""The computations of workers, one file for each kind of request; ``python -m`` of this package is
a worker."""
