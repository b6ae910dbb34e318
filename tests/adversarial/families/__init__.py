"""The families of random systems; importing this package registers them."""

from . import classics, features, laws, numbers, several, surfaces

__all__ = ["classics", "features", "laws", "numbers", "several", "surfaces"]
