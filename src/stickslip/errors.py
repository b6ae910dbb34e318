"""What can go wrong before a computation starts, said in the user's words."""

from __future__ import annotations

import re

CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]+")


class StickslipError(Exception):
    """Base of every error this library raises on purpose."""


class DeclarationError(StickslipError, ValueError):
    """A declaration, a formula or an argument is wrong.

    Parameters
    ----------
    where : str
        The key of the declaration, such as ``contacts.'right leg'.threshold``.
    reason : str
        What is wrong with it.
    remedy : str, optional
        What would be right.
    """

    def __init__(self, where: str, reason: str, remedy: str = "") -> None:
        self.where, self.reason, self.remedy = where, reason, remedy
        text = f"{where}: {reason}" if where else reason
        # One line on the terminal, whatever stands in the user's file.
        super().__init__(CONTROL.sub(" ", f"{text}. {remedy}" if remedy else text))


def short(text: str) -> str:
    """The beginning of a text that is too long for a message."""
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."
