"""Certificates of `phigen build --certify`: the results of `phigen verify` for the files of one build.

A certificate contains hashes of the spec and of the files for which it is valid.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from phigen._version import __version__
from phigen.targets.header import split

if TYPE_CHECKING:
    from phigen.compilation import Compilation
    from phigen.study.verification import Verification


def path_of(folder: Path, name: str) -> Path:
    """Return the path of the certificate of a system."""
    return folder / f"{name}.certificate.json"


def identity(compilation: Compilation, files: Mapping[str, str]) -> dict[str, Any]:
    """Return the entries of a certificate that identify a build.

    The entries are the version of phigen, the name of the system, the hash of the spec, and a checksum for each file.
    The checksum covers the text below the header of the file.
    """
    return {
        "phigen": __version__,
        "name": compilation.spec.name,
        "spec_sha256": compilation.spec.source_sha256,
        "files": {name: split(text)[0] for name, text in sorted(files.items())},
    }


def text_of(compilation: Compilation, files: Mapping[str, str], verification: Verification) -> str:
    """Return the text of a certificate.

    Apart from measured numbers, the text depends only on the spec, the files and the version of phigen.
    """
    from phigen.cli.verify import described

    data = {**identity(compilation, files), "verification": described(verification)}
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"


def obsolete(path: Path, compilation: Compilation, files: Mapping[str, str]) -> str:
    """Return the reason why the certificate ``path`` does not belong to the generated ``files``.

    The reason is "" if the certificate belongs to ``files``, or if there is no certificate.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return ""
    except (OSError, ValueError):
        return f"{path} cannot be read"
    expected = identity(compilation, files)
    if not isinstance(data, dict) or any(data.get(key) != value for key, value in expected.items()):
        return f"{path} certifies other files"
    return ""
