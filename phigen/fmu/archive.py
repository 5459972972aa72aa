"""The zip archive of an FMU, with sources, compiled libraries and descriptions. Equal contents give equal bytes."""

from __future__ import annotations

import io
import tempfile
import zipfile
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from phigen.errors import ToolchainError
from phigen.fmu.description import build_description, model_description
from phigen.fmu.platforms import PLATFORMS, TIMEOUT, compilers
from phigen.fmu.sources import layer, token_of
from phigen.fmu.variables import variables_of
from phigen.runtime import toolchain

if TYPE_CHECKING:
    from phigen.compilation import Compilation

#: Date of all files in an archive, for reproducible bytes: the earliest date of the zip format.
_DATE = (1980, 1, 1, 0, 0, 0)
_FILE, _PROGRAM = 0o100644 << 16, 0o100755 << 16


@dataclass(frozen=True)
class MockupUnit:
    """Contents of an FMU: the texts of the ``sources`` by file name, and descriptions in XML.

    ``descriptions`` maps the versions 2 and 3 of FMI to ``modelDescription.xml``; ``build`` is
    ``buildDescription.xml``, which FMI 3.0 needs.
    """

    name: str
    sources: Mapping[str, str]
    descriptions: Mapping[int, str]
    build: str


def unit_of(compilation: Compilation, solver: Mapping[str, str]) -> MockupUnit:
    """Return the contents of the FMU of a system; ``solver`` has the texts of its C header and source by file name.

    Raises `SpecError` for lattices, and for a spec without a run that goes forward in time.
    """
    name, variables = compilation.spec.name, variables_of(compilation)
    token = token_of(compilation, dict(solver))
    sources = {**solver, f"{name}_fmi.c": layer(compilation, variables, token)}
    compiled = [file for file in sources if file.endswith(".c")]
    descriptions = {v: model_description(compilation, variables, token, v, compiled) for v in (2, 3)}
    return MockupUnit(name, sources, descriptions, build_description(name, compiled))


def binaries(unit: MockupUnit, platforms: Collection[str] = ()) -> dict[str, bytes]:
    """Compile the FMU for several platforms, and return the shared libraries as bytes, by name of the platform.

    ``platforms`` are names of platforms. By default, the FMU is compiled for every platform for which there is a
    compiler. Raises `ToolchainError` if a compilation fails, or if there is no compiler for one of the ``platforms``.
    """
    available = compilers()
    unavailable = sorted(set(platforms) - set(available))
    if unavailable:
        hint = "pip install ziglang installs a compiler for all platforms"
        raise ToolchainError(f"no compiler for {', '.join(unavailable)}\n  hint: {hint}")
    libraries = {}
    with tempfile.TemporaryDirectory(prefix="phigen-") as scratch:
        folder = Path(scratch)
        for file, text in unit.sources.items():
            (folder / file).write_text(text, encoding="utf-8")
        compiled = [folder / file for file in unit.sources if file.endswith(".c")]
        for platform in platforms or available:
            output = folder / f"{platform}{PLATFORMS[platform].suffix}"
            toolchain.compile_library(compiled, output, available[platform], TIMEOUT)
            libraries[platform] = output.read_bytes()
    return libraries


def archive(unit: MockupUnit, version: int, libraries: Mapping[str, bytes]) -> bytes:
    """Return the zip file of an FMU for version 2 or 3 of FMI; ``libraries`` are compiled libraries by platform."""
    contents: dict[str, bytes] = {"modelDescription.xml": unit.descriptions[version].encode()}
    for platform, library in libraries.items():
        platform_record = PLATFORMS[platform]
        folder = platform_record.folder if version == 3 else platform_record.folder_2
        if folder:
            contents[f"binaries/{folder}/{unit.name}{platform_record.suffix}"] = library
    contents |= {f"sources/{file}": text.encode() for file, text in unit.sources.items()}
    if version == 3:
        contents["sources/buildDescription.xml"] = unit.build.encode()
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as file:
        for path, data in contents.items():
            entry = zipfile.ZipInfo(path, _DATE)
            entry.create_system = 3  # 3 is Unix; the default value depends on the machine that writes the archive
            entry.external_attr = _PROGRAM if path.startswith("binaries/") else _FILE
            entry.compress_type = zipfile.ZIP_DEFLATED
            file.writestr(entry, data)
    return content.getvalue()
