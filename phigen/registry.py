"""Registry of the targets: the languages in which phigen writes solvers, and the devices that run solvers.

Other lists of targets derive from this one: choices of the command line, allowed values in specs, suffixes of generated
files, targets that can be loaded. The modules that print and load code are imported on request.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from phigen.runtime.backend import Backend
    from phigen.runtime.interface import Interface
    from phigen.scheme.program import Program


@dataclass(frozen=True)
class Target:
    """Language in which phigen writes solvers, or a device that runs solvers.

    ``emitter`` is the module with the function ``emit(program, command)``, which returns the files (name → text). If
    ``single_file`` is true, this function also takes the argument ``single_file``. ``loader`` is the module with the
    function ``load(files, interface)``, which returns a loaded solver; it is empty if Python cannot run the files.
    ``suffixes`` has the suffixes of all files, the suffix of the main file first. ``default`` is true for targets that
    a spec gets if it names none. ``compiled`` is true if a compiler is needed.

    ``device`` is true for a device, such as OpenCL. A device runs files of the target named "device". The solver of a
    device also contains files in C or NumPy, which run on the processor.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    emitter: str
    loader: str = ""
    default: bool = False
    single_file: bool = False
    compiled: bool = False
    device: bool = False

    def emit(self, program: Program, command: str, *, single_file: bool = False) -> dict[str, str]:
        """Print a program in the language of the target, and return the files (name → text).

        ``command`` is the command line that regenerates the files; it is written into their headers.
        """
        options = {"single_file": True} if single_file and self.single_file else {}
        return cast(dict[str, str], import_module(self.emitter).emit(program, command, **options))

    def expect_offered(self, program: Program) -> None:
        """Raise `SpecError` if the target cannot express the program. `emit` would raise the same error."""
        refuse = getattr(import_module(self.emitter), "expect_offered", None)
        if refuse is not None:
            refuse(program)

    def load(self, files: Mapping[str, str], interface: Interface, device: int | None = None) -> Backend:
        """Return the loaded solver of generated files. ``device`` is the number of a device.

        Raises `ToolchainError`.
        """
        options = {} if device is None else {"device": device}
        return cast("Backend", import_module(self.loader).load(files, interface, **options))


_LISTED = (
    Target(
        "c",
        "C",
        (".c", ".h"),
        "phigen.targets.c.emitter",
        "phigen.runtime.c_solver",
        default=True,
        single_file=True,
        compiled=True,
    ),
    Target("numpy", "NumPy", (".py",), "phigen.targets.numpy.emitter", "phigen.runtime.numpy_solver", default=True),
    Target("device", "OpenCL, CUDA and HIP", ("_device.h",), "phigen.targets.device.emitter"),
    Target("js", "JavaScript", (".mjs",), "phigen.targets.js.emitter"),
)

#: The targets that are languages, by name.
TARGETS: Mapping[str, Target] = {target.name: target for target in _LISTED}

_DEVICE = TARGETS["device"]

#: The devices, by name: libraries for graphics cards. All devices run the files of the target "device".
DEVICES: Mapping[str, Target] = {
    name: replace(_DEVICE, name=name, title=title, loader=f"phigen.runtime.devices.{name}", device=True)
    for name, title in (("opencl", "OpenCL"), ("cuda", "CUDA"))
}

#: DEFAULT: names of the targets that a spec gets if it names none. LOADABLE: names of the languages in which Python can
#: load solvers.
DEFAULT = tuple(target.name for target in _LISTED if target.default)
LOADABLE = tuple(target.name for target in _LISTED if target.loader)

#: Names of all targets and devices on which Python can run a solver.
RUNNABLE = (*LOADABLE, *DEVICES)


def find(name: str) -> Target:
    """Return the target with this name, a language or a device. Raises `ValueError` with a hint if there is none."""
    if name in DEVICES:
        return DEVICES[name]
    if name not in TARGETS:
        names = {word: t.name for t in (*_LISTED, *DEVICES.values()) for word in (t.name, t.title.lower())}
        from difflib import get_close_matches

        similar_names = get_close_matches(name.lower(), names, 1)
        hint = (
            f"did you mean {names[similar_names[0]]!r}?"
            if similar_names
            else f"there are {', '.join((*TARGETS, *DEVICES))}"
        )
        raise ValueError(f"unknown target {name!r}; {hint}")
    return TARGETS[name]


def automatic(*, compiler: bool) -> str:
    """Return the name of the target that ``auto`` stands for: the first target that Python can load.

    ``compiler`` says whether there is a C compiler. Without a compiler, targets that need one are left out.
    """
    return next(name for name in LOADABLE if compiler or not TARGETS[name].compiled)


def suffixes(targets: Iterable[str] = TARGETS) -> list[str]:
    """Return the suffixes of the files of some targets, by default of all targets."""
    return [suffix for target in targets for suffix in TARGETS[target].suffixes]


def loadable(targets: Iterable[str]) -> tuple[str, ...]:
    """Return the names in ``targets`` whose solvers Python can load."""
    return tuple(target for target in targets if target in LOADABLE)


def target_of(files: Iterable[str], name: str) -> Target:
    """Return the target in whose language ``files`` are written. ``name`` is that of the solver.

    The target is recognised by the name of the main file.
    """
    file_names = set(files)
    return next(target for target in _LISTED if f"{name}{target.suffixes[0]}" in file_names)
