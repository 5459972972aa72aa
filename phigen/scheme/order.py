"""The order of a method and the terms of the series that give it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Order:
    """The order of the method and the number of terms S_1 … S_k that give it."""

    order: int
    terms: int
    note: str = ""


def plan_order(order: int | None, terms: int | None, *, symmetric: bool) -> Order:
    """Return the order and the number of terms, from the one of them that is not None.

    In a symmetric bi-realisation the even S_i vanish and the method is symmetric, so its order is even: S_1 … S_k with
    k odd result in order k + 1. Otherwise S_1 … S_k result in order k.
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
