"""Examples in pages of documentation: files are written, commands are run, and their output is compared with
the page.

A fenced block is a file if the last sentence before the block starts with the name of the file in backquotes. A
``console`` block contains commands after ``$``, each followed by its output. In the output ``…`` stands for any text,
and a line ``…`` for any number of lines. Numbers with a decimal point need not agree to the last digit.
"""

from __future__ import annotations

import contextlib
import math
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

from click.testing import CliRunner

from phigen.cli import group

ROOT = Path(__file__).resolve().parent.parent
_NUMBER = r"(?<![\w./-])-?\d+\.\d+(?:e[+-]\d+)?(?![\w./])"
_FILES = ("yaml", "python", "c", "js", "sh")


def blocks(text: str) -> list[tuple[str, str, str]]:
    """Return for each fenced block the paragraph before the block, the language, and the text of the block."""
    examples = []
    for match in re.finditer(r"^```(\w+)\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE):
        paragraph = text[: match.start()].rstrip().rsplit("\n\n", 1)[-1]
        examples.append((paragraph, match[1], match[2]))
    return examples


def file_named_in(paragraph: str) -> str | None:
    """Return the file name with which the last sentence of the paragraph starts, or None."""
    match = re.search(r"(?:^|[.:;]\s+)`([\w-]+\.\w+)`[^`]*:$", paragraph)
    return match[1] if match else None


def follow(page: Path, folder: Path) -> int:
    """Write the files of a page into a folder and run its commands there; return the number of commands."""
    environment = _environment(folder)
    count = 0
    for paragraph, language, text in blocks(page.read_text(encoding="utf-8")):
        name = file_named_in(paragraph)
        if language in _FILES and name:
            (folder / name).write_text(text, encoding="utf-8")
        elif language == "console":
            count += _type(text, folder, environment)
    return count


def labels_of(svg: str) -> list[str]:
    """Return the labels in an SVG file, without the numbers along its axes."""
    labels = re.findall(r"<text[^>]*>([^<]*)</text>", svg)
    return [label for label in labels if not re.fullmatch(r"[−\d.]*", label)]


def _environment(folder: Path) -> dict[str, str]:
    tools = folder / ".tools"
    tools.mkdir()
    for name, call in (("phigen", '-c "from phigen.cli import main; main()"'), ("python", "")):
        (tools / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {call} "$@"\n')
        (tools / name).chmod(0o755)
    path = f"{tools}{os.pathsep}{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), "NO_COLOR": "1"}


def _type(text: str, folder: Path, environment: dict[str, str]) -> int:
    status, parts = 0, re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]
    for part in parts:
        command, _, answer = part.partition("\n")
        status, said = typed(command, folder, environment, status)
        assert _agrees(answer, said), f"$ {command}\n{said}\n--- the page says ---\n{answer}"
    return len(parts)


def typed(command: str, folder: Path, environment: dict[str, str], status: int = 0) -> tuple[int, str]:
    """Run a command and return its exit code and output. A ``phigen`` command runs in this process unless it needs the
    shell.
    """
    words = shlex.split(command)
    if words[0] == "phigen" and not set(command) & set("|&;<>$*~"):
        with contextlib.chdir(folder):
            result = CliRunner().invoke(group, words[1:], prog_name="phigen", env={"NO_COLOR": "1"})
        return result.exit_code, result.output
    # The shell begins with the exit status of the previous command, so that ``echo $?`` prints it.
    typed = subprocess.run(
        ["sh", "-c", f"(exit {status})\n{command}"], cwd=folder, env=environment, check=False, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    return typed.returncode, typed.stdout


def _agrees(answer: str, output: str) -> bool:
    """Whether the output of a command agrees with that in the page: numbers up to two per cent, numbers below 1e-12
    always.
    """
    pattern = "".join(r"(?:.*\n)*?" if line == "…" else _pattern(line) + r"\n" for line in answer.splitlines())
    match = re.fullmatch(pattern, output)
    return bool(match) and all(
        math.isclose(float(said), float(printed), rel_tol=0.02) or max(abs(float(said)), abs(float(printed))) < 1e-12
        for said, printed in zip(_said(answer), match.groups(), strict=True)
    )


def _said(answer: str) -> list[str]:
    return [number for line in answer.splitlines() for number in re.findall(_NUMBER, line)]


def _pattern(line: str) -> str:
    """Return a regular expression for a line: numbers are groups, and the number of blanks is arbitrary, as the widths
    of columns depend on those of numbers.
    """
    pieces = re.split(_NUMBER, line)
    texts = [re.sub(r"(?:\\ )+", " +", re.escape(text).replace("…", ".*")) for text in pieces]
    return rf"({_NUMBER})".join(texts)
