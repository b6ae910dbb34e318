"""Answers of a worker, and their transfer through a pipe."""

from __future__ import annotations

import pickle
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import IO, Any

from stickslip.arrays import Array
from stickslip.errors import DeclarationError

_LENGTH = struct.Struct("<Q")


@dataclass(frozen=True)
class Answer:
    """A part of the answer to a request.

    Attributes
    ----------
    head : mapping
        Texts and numbers.
    arrays : mapping of str to array
        Data of the figures.
    """

    head: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Ready:
    """A worker has loaded what it needs."""


@dataclass(frozen=True)
class Compiling:
    """A worker compiles the engine for this machine, which takes minutes, once."""


@dataclass(frozen=True)
class WorkerMessage:
    """Message of a worker on a question: a part of the answer, or its end."""

    serial: int
    answer: Answer | None
    final: bool = False


def refusal(error: Exception, where: str = "") -> Answer:
    """An error for the page: the name of the input, the reason and the remedy."""
    said = {"where": where, "reason": str(error), "remedy": ""}
    if isinstance(error, DeclarationError):
        said = {"where": error.where, "reason": error.reason, "remedy": error.remedy}
    return Answer({"refused": said})


def send_frame(stream: IO[bytes], thing: object) -> None:
    """Write a message and its length."""
    data = pickle.dumps(thing, protocol=pickle.HIGHEST_PROTOCOL)
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def receive_frame(stream: IO[bytes]) -> Any:
    """The next message of a stream between this program and its workers.

    Raises
    ------
    EOFError
        If the other end has closed it.
    """
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError
    (length,) = _LENGTH.unpack(head)
    data = stream.read(length)
    if len(data) < length:
        raise EOFError
    return pickle.loads(data)
