"""The targets: the languages that phigen writes solvers in.

Every list of targets derives from this one: choices of the command line, allowed values in specs, suffixes of
generated files, targets that can be loaded. Emitters and loaders are imported on request.
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
    """A language in which phigen writes solvers.

    ``emitter`` is the module whose ``emit(program, command)`` gives file names and their contents; it takes
    ``single_file`` too if that is offered. ``loader`` is the module whose ``load(files, interface)`` makes a back end
    of them, empty if Python cannot run them. ``suffixes`` are the suffixes of all files, the main file's first.
    Specs that name no targets get the targets with ``default``. A ``device`` is where Python runs the files of the
    target device; the host runs the files of another target.
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
        """File names and contents; ``command`` is what regenerates them."""
        options = {"single_file": True} if single_file and self.single_file else {}
        return cast(dict[str, str], import_module(self.emitter).emit(program, command, **options))

    def expect_offered(self, program: Program) -> None:
        """Raise the `SpecError` with which ``emit`` would refuse a program, without emitting it."""
        refuse = getattr(import_module(self.emitter), "expect_offered", None)
        if refuse is not None:
            refuse(program)

    def load(self, files: Mapping[str, str], interface: Interface, device: int | None = None) -> Backend:
        """The back end of generated files, on the device of a number. Raises `ToolchainError`."""
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

#: All targets by name.
TARGETS: Mapping[str, Target] = {target.name: target for target in _LISTED}

_DEVICE = TARGETS["device"]

#: The device on which Python runs the files of the target device.
DEVICES: Mapping[str, Target] = {
    name: replace(_DEVICE, name=name, title=title, loader=f"phigen.runtime.devices.{name}", device=True)
    for name, title in (("opencl", "OpenCL"), ("cuda", "CUDA"))
}

#: Default targets of specs, and targets that Python can run.
DEFAULT = tuple(target.name for target in _LISTED if target.default)
LOADABLE = tuple(target.name for target in _LISTED if target.loader)

#: The names of all that Python can run a solver on.
RUNNABLE = (*LOADABLE, *DEVICES)


def find(name: str) -> Target:
    """The target or device of that name. Raises `ValueError` with a hint if there is none."""
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
    """Return the default target: the first that Python can run on this machine."""
    return next(name for name in LOADABLE if compiler or not TARGETS[name].compiled)


def suffixes(targets: Iterable[str] = TARGETS) -> list[str]:
    """The suffixes of the files of these targets, of all by default."""
    return [suffix for target in targets for suffix in TARGETS[target].suffixes]


def loadable(targets: Iterable[str]) -> tuple[str, ...]:
    """Those among some targets that Python can run."""
    return tuple(target for target in targets if target in LOADABLE)


def target_of(files: Iterable[str], name: str) -> Target:
    """The target whose main file is among the files of a solver."""
    file_names = set(files)
    return next(target for target in _LISTED if f"{name}{target.suffixes[0]}" in file_names)
