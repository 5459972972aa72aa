"""Layout of generated C: line breaks for at most 110 columns, and alignment of comments."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator

WIDTH = 110

#: Pattern of a line of code with a comment at its end.
_BEHIND = re.compile(r"( *[^ /].*?[;,0-9A-Z]) +(/\*.*\*/)")
_STRING = re.compile(r'"[^"]*"')

#: Penalties of a line break inside parentheses and inside brackets, in columns for each level of nesting.
_DEPTH, _INDEX = 18, 60

#: Penalties of a line break at an operator, in columns. They are larger for operators that bind more strongly.
_BOUND = dict.fromkeys("*/", 50) | dict.fromkeys("+-", 36) | dict.fromkeys(("<", ">", "<=", ">=", "==", "!="), 28)


def fitted(text: str) -> str:
    """Return the text with long lines of code broken, long comments wrapped, and comments at the ends of lines
    aligned.
    """
    return "\n".join([*_aligned(_lines(text.split("\n")))][:-1])


def _aligned(lines: Iterable[str]) -> Iterator[str]:
    """Yield the lines. Comments at the ends of consecutive lines are aligned, if the lines do not become too long."""
    run: list[tuple[str, str]] = []
    for line in [*lines, ""]:
        match = _BEHIND.fullmatch(line) if line.endswith("*/") else None
        if match:
            run.append((match[1], match[2]))
            continue
        width = max((len(code) for code, _ in run), default=0)
        fits = all(width + 1 + len(said) <= WIDTH for _, said in run)
        yield from (f"{code:{width}} {said}" if fits else f"{code} {said}" for code, said in run)
        run = []
        yield line


def _lines(lines: list[str]) -> Iterator[str]:
    k = 0
    while k < len(lines):
        end = k
        if lines[k].lstrip().startswith("/*"):
            end = next(j for j in range(k, len(lines)) if "*/" in lines[j])
        elif lines[k].startswith("#"):
            end = next(j for j in range(k, len(lines)) if not lines[j].endswith("\\"))
        else:
            end = _statement(lines, k)
        block, k = lines[k : end + 1], end + 1
        if max(map(len, block)) <= WIDTH:
            yield from block
        elif block[0].endswith("\\"):
            yield from _macro(block)
        elif block[0].startswith("#") and "/*" not in block[0]:
            *first, last = textwrap.wrap(block[0], WIDTH - 2, subsequent_indent="    ", break_on_hyphens=False)
            yield from (*(f"{line} \\" for line in first), last)
        elif block[-1].endswith("*/") and block[0].lstrip().startswith("/*"):
            yield from comment(" ".join(line.strip() for line in block), _indent(block[0]))
        else:
            whole = " ".join([block[0], *(line.strip() for line in block[1:])])
            yield from _code(whole)
            if _FUNCTION.fullmatch(whole) and k < len(lines) and lines[k]:
                yield ""


def _macro(lines: list[str]) -> Iterator[str]:
    """Yield the lines of a macro definition; long lines are broken."""
    for line in lines:
        *first, last = _code(line.removesuffix(" \\"), WIDTH - 2)
        yield from (f"{part} \\" for part in first)
        yield f"{last} \\" if line.endswith(" \\") else last


def _statement(lines: list[str], first: int) -> int:
    """Return the index of the line in which all parentheses of a statement are closed."""
    depth = 0
    for k in range(first, len(lines)):
        code = _STRING.sub("", lines[k]) if '"' in lines[k] else lines[k]
        depth += code.count("(") - code.count(")")
        if depth <= 0:
            return k
    return first


def comment(text: str, indent: str = "") -> list[str]:
    """Return the lines of a comment with its marks, wrapped. The closing mark never stands alone on a line."""
    lines = textwrap.wrap(
        text.replace(" */", "\N{NO-BREAK SPACE}*/"),
        WIDTH,
        initial_indent=indent,
        subsequent_indent=f"{indent}   ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def _indent(line: str) -> str:
    return line[: len(line) - len(line.lstrip())]


#: Pattern of a function whose definition is one line with one statement.
_FUNCTION = re.compile(r"(\S.*\)) \{ (.*;) \}")


def _code(line: str, width: int = WIDTH) -> Iterator[str]:
    if function := _FUNCTION.fullmatch(line):
        yield from (*_code(function[1]), "{", *_code(f"    {function[2]}"), "}")
        return
    match = re.match(r"(.*?\S)\s+(/\*.*\*/)$", line)
    if match:
        yield from comment(match[2], _indent(line))
        line = match[1]
    further = _indent(line) + "    "
    while len(line) > width:
        place = max(_places(line, len(further), width), default=(0, 0))[1]
        if place == 0 and "(" in line[:width]:
            place = line.index("(") + 1
        if place == 0:
            break
        yield line[:place].rstrip()
        line = further + line[place:].lstrip()
    yield line


def _places(line: str, least: int, width: int) -> Iterator[tuple[int, int]]:
    """Yield the columns at which a line may be broken, as pairs (score, column). The column with the highest score is
    the best.
    """
    depth, index, head = 0, 0, re.match(r" *(for|if|while) \(", line)
    line = _STRING.sub(lambda match: "'" * len(match[0]), line)
    for k, c in enumerate(line[: width + 1]):
        depth += (c in "({") - (c in ")}")
        index += (c == "[") - (c == "]")
        if c != " " or k <= least:
            continue
        after_loop = head is not None and depth == 0 and line[k - 1] == ")"
        head = None if after_loop else head
        operator = re.match(r" ([-+*/?:<>]|&&|\|\||[<>=!]=) ", line[k:])
        label = line[k - 1] == ":" and line.lstrip().startswith("case ")
        assigned = line[k - 1] == "=" and line[k - 2] not in "<>=!"
        if line[k - 1] in ",;" or assigned or operator or after_loop or label:
            bound = _BOUND.get(operator[1], 0) if operator else 12 * assigned
            yield k - _DEPTH * depth - _INDEX * index - bound + (width if after_loop else 0), k
