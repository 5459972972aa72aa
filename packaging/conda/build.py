"""Build the conda package and run its tests without a channel of the network: python packaging/conda/build.py FOLDER

Needs ``pip install py-rattler-build py-rattler``, and an index of Python packages. Conda packages of the dependencies
are made from wheels, in FOLDER/channel. The package ``python`` there is a virtual environment of the Python that runs
this script, so this channel serves for tests on this machine only. The package of phigen is written to FOLDER/output.
"""

from __future__ import annotations

import asyncio
import hashlib
import io
import json
import platform
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Mapping
from email import message_from_string
from pathlib import Path

RECIPE = Path(__file__).with_name("recipe.yaml")
SITE = f"lib/python3.{sys.version_info.minor}/site-packages"
#: Wheels to convert: the requirements of the recipe except python. pip finds their dependencies.
REQUIREMENTS = ("pip", "hatchling", "click", "jinja2", "numpy", "python-flint", "ruamel.yaml", "sympy")
#: Dependencies of these packages.
DEPENDS = {
    "hatchling": ["packaging", "pathspec", "pluggy", "trove-classifiers"],
    "jinja2": ["markupsafe"],
    "sympy": ["mpmath"],
}


def write_package(
    channel: Path, name: str, version: str, files: Mapping[str, bytes], links: Mapping[str, str], *, pure: bool
) -> None:
    """Write a conda package with these files and symbolic links; ``pure`` packages are for all platforms."""
    subdir = "noarch" if pure else "linux-64"
    depends = [] if name == "python" else ["python", *DEPENDS.get(name, [])]
    index: dict[str, object] = {"name": name, "version": version, "build": "0", "build_number": 0, "subdir": subdir}
    index |= {"depends": depends, **({"noarch": "python"} if pure else {})}
    hashes = {path: ("hardlink", data) for path, data in files.items()} | dict.fromkeys(links, ("softlink", b""))
    paths = [
        {"_path": path, "path_type": kind, "sha256": hashlib.sha256(data).hexdigest(), "size_in_bytes": len(data)}
        for path, (kind, data) in hashes.items()
    ]
    about = {"info/index.json": index, "info/paths.json": {"paths": paths, "paths_version": 1}}
    if pure:
        about["info/link.json"] = {"noarch": {"type": "python"}, "package_metadata_version": 1}
    (channel / subdir).mkdir(parents=True, exist_ok=True)
    with tarfile.open(channel / subdir / f"{name}-{version}-0.tar.bz2", "w:bz2") as archive:
        for path, data in {**files, **{path: json.dumps(value).encode() for path, value in about.items()}}.items():
            entry = tarfile.TarInfo(path)
            entry.size = len(data)
            archive.addfile(entry, io.BytesIO(data))
        for path, target in links.items():
            entry = tarfile.TarInfo(path)
            entry.type, entry.linkname = tarfile.SYMTYPE, target
            archive.addfile(entry)


def write_python(channel: Path) -> None:
    """Write the package ``python``: links to the Python that runs this script, as in a virtual environment."""
    program = Path(sys.executable).resolve()
    settings = f"home = {program.parent}\ninclude-system-site-packages = false\nversion = {platform.python_version()}\n"
    links = dict.fromkeys(("bin/python", "bin/python3", f"bin/python3.{sys.version_info.minor}"), str(program))
    files = {"pyvenv.cfg": settings.encode(), f"{SITE}/README.txt": b"Packages.\n"}
    write_package(channel, "python", platform.python_version(), files, links, pure=False)


def write_wheel(channel: Path, wheel: Path) -> None:
    """Write the files of a wheel as a conda package, without its scripts."""
    pure = wheel.name.endswith("-any.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = [name for name in archive.namelist() if not name.endswith("/") and ".data/" not in name]
        (about,) = (name for name in names if name.count("/") == 1 and name.endswith(".dist-info/METADATA"))
        metadata = message_from_string(archive.read(about).decode())
        files = {f"{'site-packages' if pure else SITE}/{name}": archive.read(name) for name in names}
    write_package(channel, metadata["Name"].lower().replace("_", "-"), metadata["Version"], files, {}, pure=pure)


def main(folder: Path) -> None:
    """Make the channel, build the package from the recipe, and run the tests of the recipe."""
    from rattler.index import index_fs
    from rattler_build import Package, Stage0Recipe

    channel, output = folder / "channel", folder / "output"
    write_python(channel)
    with tempfile.TemporaryDirectory() as wheels:
        subprocess.run([sys.executable, "-m", "pip", "download", "-q", "-d", wheels, *REQUIREMENTS], check=True)
        for wheel in sorted(Path(wheels).glob("*.whl")):
            write_wheel(channel, wheel)
    asyncio.run(index_fs(channel))
    (variant,) = Stage0Recipe.from_file(RECIPE).render()
    built = variant.run_build(output_dir=output, channels=[channel.resolve().as_uri()])
    for package in built.packages:
        for test in Package.from_file(package).run_tests(channel=[channel.resolve().as_uri()]):
            if not test.success:
                raise SystemExit("\n".join(test.output))
        print(f"built and tested {package}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
