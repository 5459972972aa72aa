"""The algebra in which methods for {V, {V, {V, T}}} = 0 are compared with the flow: words in T and V, where VVVT can be
rewritten as 3 VVTV − 3 VTVV + TVVV. No word ends as it begins there, so each has one normal form, without VVVT.

Elements map words of bounded length to multiples of 1/`ONE`, as integers.
"""

from collections import defaultdict
from functools import cache
from math import hypot

DIGITS = 50
ONE = 10**DIGITS


@cache
def extended(word, letter):
    """Return the normal form of a word extended by a letter."""
    if letter == "V" or not word.endswith("VVV"):
        return {word + letter: 1}
    coefficients = defaultdict(int)
    for factor, end in ((3, "VVTV"), (-3, "VTVV"), (1, "TVVV")):
        for w, c in _written(word[:-3], end).items():
            coefficients[w] += factor * c
    return dict(coefficients)


def _written(word, letters):
    current = {word: 1}
    for letter in letters:
        current = times(current, letter)
    return current


def times(element, letter):
    """Return the product of an element and a letter."""
    product = defaultdict(int)
    for word, value in element.items():
        for w, c in extended(word, letter).items():
            product[w] += value * c
    return product


def combined(*terms):
    """Return a linear combination of elements."""
    coefficients = defaultdict(int)
    for factor, element in terms:
        for word, value in element.items():
            coefficients[word] += factor * value
    return coefficients


def gradient(element):
    """Return the product of an element and [V, [V, T]]."""
    after = {"": element}
    for word in ("V", "T", "VV", "VT", "TV", "VVT", "VTV", "TVV"):
        after[word] = times(after[word[:-1]], word[-1])
    return combined((1, after["VVT"]), (-2, after["VTV"]), (1, after["TVV"]))


def exponential(element, act, time, degree):
    """Return the product of an element and exp(time · act), up to a degree."""
    total = term = element
    k = 0
    while any(term.values()):
        k += 1
        term = {w: v * time // ONE // k for w, v in act(term).items() if len(w) <= degree}
        total = combined((1, total), (1, term))
    return total


def defects(method, degree):
    """Return, for each degree, the Euclidean norm of the difference between a step and the flow of T + V."""
    step, multiples = {"": ONE}, iter(method.multiples)
    for i, time in enumerate(method.times):
        kicks = i % 2 != method.kicks_first
        t = int(time * ONE)
        step = exponential(step, lambda e, kicks=kicks: times(e, "V" if kicks else "T"), t, degree)
        if kicks and method.multiples:
            step = exponential(step, gradient, int(next(multiples) * t), degree)
    flow = exponential({"": ONE}, lambda e: combined((1, times(e, "T")), (1, times(e, "V"))), ONE, degree)
    difference = combined((1, step), (-1, flow))
    return {d: hypot(*(v / ONE for w, v in difference.items() if len(w) == d)) for d in range(1, degree + 1)}
