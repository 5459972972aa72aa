"""The order of a method, and the number of its terms S_1, S_2, … or of its stages."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Order:
    """The order of a method, and its number of ``terms``.

    The terms are the S_1 … S_k of the generating function or, for Gauss methods, the stages. ``note`` tells the user if
    the order or the number of terms differs from what was asked for.
    """

    order: int
    terms: int
    note: str = ""


def plan_order(order: int | None, terms: int | None, *, symmetric: bool) -> Order:
    """Return the order and the number of terms of a method. Exactly one of the arguments ``order`` and ``terms`` is
    None.

    In a symmetric bi-realisation the terms S_i with even i vanish, and the method is symmetric, so its order is even:
    the terms S_1 … S_k with odd k give order k + 1. In any other bi-realisation S_1 … S_k give order k.
    """
    if terms is not None:
        if not symmetric:
            return Order(terms, terms)
        odd = terms if terms % 2 else terms - 1 or 1
        note = "" if odd == terms else f"S_{terms} = 0 in a symmetric bi-realisation"
        return Order(odd + 1, odd, note)
    if order is None:
        raise ValueError("a method needs an order or terms")
    if not symmetric:
        return Order(order, order)
    if order % 2:
        return Order(order + 1, order, f"order {order} was asked for; a symmetric method has even order")
    return Order(order, order - 1)
