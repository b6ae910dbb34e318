"""What is made of an object once."""

from __future__ import annotations

import functools
import re
import threading
from pathlib import Path

import pytest

import stickslip
from stickslip.kept import cached_property, kept, made_once

SOURCES = Path(stickslip.__file__).parent


class Pair:
    """Two properties, each of which needs the other one of another pair."""

    def __init__(self, met: threading.Barrier | None = None, other: Pair | None = None) -> None:
        self.met = met
        self.other = other
        self.made = 0

    def need(self, name: str) -> int:
        self.made += 1
        if self.met is not None and self.other is not None:
            self.met.wait(10.0)
            return 1 + getattr(self.other, name)
        return 1

    @cached_property
    def one(self) -> int:
        return self.need("two")

    @cached_property
    def two(self) -> int:
        return self.need("one")


def test_threads_that_need_each_others_properties_end() -> None:
    """With a lock for each property, as functools had it before Python 3.12, they wait for ever."""
    met = threading.Barrier(2)
    first, second = Pair(met, Pair()), Pair(met, Pair())
    threads = [
        threading.Thread(target=getattr, args=(pair, name), daemon=True)
        for pair, name in ((first, "one"), (second, "two"))
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10.0)
    assert not any(thread.is_alive() for thread in threads)
    assert (first.one, second.two) == (2, 2)


def test_it_is_worked_out_once_and_may_be_given() -> None:
    pair = Pair()
    assert (pair.one, pair.one, pair.made) == (1, 1, 1)
    vars(pair)["two"] = 5
    assert (pair.two, pair.made) == (5, 1)
    assert isinstance(Pair.one, cached_property)


def test_no_property_has_a_lock_for_all_objects() -> None:
    taken = re.compile(r"functools[. ]+(import .*)?cached_property")
    assert not [path for path in SOURCES.rglob("*.py") if taken.search(path.read_text("utf-8"))]
    assert taken.search("from functools import cache, cached_property")
    assert functools.cached_property is not cached_property


@pytest.mark.parametrize("most", [1, 3])
def test_few_are_kept_where_few_are_asked_for(most: int) -> None:
    pair = Pair()
    for k in range(10):
        assert made_once(pair, "squares", lambda k=k: k * k, k, most) == k * k
        assert len(vars(pair)["_kept"]["squares"]) <= most


def test_another_thread_may_discard_what_has_just_been_made() -> None:
    """What was made is returned all the same. Here the key does, between two looks, what a thread
    does at a bad moment."""

    class Owner:
        pass

    class Key:
        looks = 0

        def __hash__(self) -> int:
            self.looks += 1
            if self.looks > 2:
                kept(owner, "numbers").clear()
            return 1

    owner = Owner()
    assert made_once(owner, "numbers", lambda: 7, Key(), most=4) == 7
