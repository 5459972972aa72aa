"""JavaScript in Node: one process, started once, runs the code of all tests of a worker."""

from __future__ import annotations

import json
import subprocess
from functools import cache
from pathlib import Path
from threading import Timer
from typing import Any

from tools import tool

_SECONDS = 300.0

#: Program of the process: it reads JSON lines, each with a module and the body of a function, and writes the results.
_SERVER = """
import { createInterface } from 'node:readline'
const Work = (async () => {}).constructor
for await (const line of createInterface({ input: process.stdin })) {
  const { module, body } = JSON.parse(line)
  let answer
  try {
    answer = { value: await new Work('module', `'use strict'; ${body}`)(await import(module)) ?? null }
  } catch (error) {
    answer = { error: String(error.stack ?? error) }
  }
  console.log(JSON.stringify(answer))
}
"""


def asked(module: Path, body: str) -> Any:
    """Return the result of a JavaScript function with this body and the parameter ``module``. The test fails if the
    function throws or takes too long.
    """
    process = _started(tool("node"))
    late = Timer(_SECONDS, process.kill)
    late.start()
    try:
        process.stdin.write(json.dumps({"module": module.as_uri(), "body": body}) + "\n")  # type: ignore[union-attr]
        process.stdin.flush()  # type: ignore[union-attr]
        line = process.stdout.readline()  # type: ignore[union-attr]
    finally:
        late.cancel()
    if not line:
        _started.cache_clear()
        raise AssertionError(f"node ended, or did not answer within {_SECONDS:g} s: {body[:200]}")
    answer = json.loads(line)
    assert "error" not in answer, answer["error"]
    return answer["value"]


@cache
def _started(program: str) -> subprocess.Popen[str]:
    """Return a running Node process. It ends when its standard input is closed, at the latest with this process."""
    command = [program, "--input-type=module", "-e", _SERVER]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def answers(script: Path, jobs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the results of the function ``answers`` of a script for some jobs. NaN arrives as the string "NaN"."""
    return list(json.loads(asked(script, f"return module.answers(JSON.parse({json.dumps(json.dumps(jobs))}))")))
