"""Pages of documentation followed to the letter: files written, commands typed, answers compared.

A fenced block is a file if the last sentence before it starts with its name in backquotes. A ``console`` block holds
commands after ``$`` and what they answer; ``…`` stands for anything, a line of its own for any lines. Numbers with
a point need not agree to the last digit.
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
    """The paragraph before each fenced block, its language, and its text."""
    examples = []
    for match in re.finditer(r"^```(\w+)\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE):
        paragraph = text[: match.start()].rstrip().rsplit("\n\n", 1)[-1]
        examples.append((paragraph, match[1], match[2]))
    return examples


def file_named_in(paragraph: str) -> str | None:
    """`name.suffix` at the start of the paragraph's last sentence."""
    match = re.search(r"(?:^|[.:;]\s+)`([\w-]+\.\w+)`[^`]*:$", paragraph)
    return match[1] if match else None


def follow(page: Path, folder: Path) -> int:
    """Do in a folder what the page says; the number of commands whose answers were compared."""
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
    """The labels in an SVG file but the numbers along its axes."""
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
    """The exit code of a command, and what it said. phigen works in this process, unless the shell is needed."""
    words = shlex.split(command)
    if words[0] == "phigen" and not set(command) & set("|&;<>$*~"):
        with contextlib.chdir(folder):
            result = CliRunner().invoke(group, words[1:], prog_name="phigen", env={"NO_COLOR": "1"})
        return result.exit_code, result.output
    # So that echo $? tells about the command before it.
    typed = subprocess.run(
        ["sh", "-c", f"(exit {status})\n{command}"], cwd=folder, env=environment, check=False, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    return typed.returncode, typed.stdout


def _agrees(answer: str, output: str) -> bool:
    """Whether an answer of the page is that of today: numbers to two per cent, round-off as such."""
    pattern = "".join(r"(?:.*\n)*?" if line == "…" else _pattern(line) + r"\n" for line in answer.splitlines())
    match = re.fullmatch(pattern, output)
    return bool(match) and all(
        math.isclose(float(said), float(printed), rel_tol=0.02) or max(abs(float(said)), abs(float(printed))) < 1e-12
        for said, printed in zip(_said(answer), match.groups(), strict=True)
    )


def _said(answer: str) -> list[str]:
    return [number for line in answer.splitlines() for number in re.findall(_NUMBER, line)]


def _pattern(line: str) -> str:
    """Numbers as groups, blanks in any quantity: columns move with the width of numbers."""
    pieces = re.split(_NUMBER, line)
    texts = [re.sub(r"(?:\\ )+", " +", re.escape(text).replace("…", ".*")) for text in pieces]
    return rf"({_NUMBER})".join(texts)
