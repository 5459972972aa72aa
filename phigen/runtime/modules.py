"""Loading of generated Python modules from their source text."""

from __future__ import annotations

import hashlib
import linecache
from types import ModuleType


def load_module(source: str, name: str) -> ModuleType:
    """Return the module that a source text defines; tracebacks show its lines."""
    filename = f"<phigen {name} {hashlib.sha256(source.encode()).hexdigest()[:12]}>"
    # No modification time: linecache.checkcache leaves such entries alone.
    linecache.cache[filename] = (len(source), None, source.splitlines(keepends=True), filename)
    module = ModuleType(name)
    module.__file__ = filename
    exec(compile(source, filename, "exec"), module.__dict__)  # text that phigen itself generated
    return module
