"""Pages of documentation followed to the letter: files written, commands typed, answers compared.

A fenced block is a file if the last sentence before it starts with its name in backquotes. A ``console`` block holds
commands after ``$`` and what they answer; ``…`` stands for anything, a line of its own for any lines.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
_FILES = ("yaml", "python", "c", "sh")


def blocks(text: str) -> list[tuple[str, str, str]]:
    """The paragraph before each fenced block, its language, and its text."""
    found = []
    for match in re.finditer(r"^```(\w+)\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE):
        paragraph = text[: match.start()].rstrip().rsplit("\n\n", 1)[-1]
        found.append((paragraph, match[1], match[2]))
    return found


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
        # So that echo $? tells about the command before it.
        done = subprocess.run(
            ["sh", "-c", f"(exit {status})\n{command}"], cwd=folder, env=environment, check=False, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        status = done.returncode
        assert re.fullmatch(_pattern(answer), done.stdout), (
            f"$ {command}\n{done.stdout}\n--- the page says ---\n{answer}"
        )
    return len(parts)


def _pattern(answer: str) -> str:
    return "".join(
        r"(?:.*\n)*?" if line == "…" else re.escape(line).replace("…", ".*") + r"\n" for line in answer.splitlines()
    )
