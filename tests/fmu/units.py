"""FMUs for tests: compiled for this machine, and opened by fmpy."""

from __future__ import annotations

import contextlib
import zipfile
from dataclasses import replace

import pytest

from phigen import resources
from phigen import spec as specs
from phigen.compiler import compile_proved, emit
from phigen.fmu.archive import archive, unit_of
from phigen.fmu.platforms import FLAGS, host
from phigen.runtime import toolchain

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")


def unit(source, **options):
    """Return the compilation of a spec, given by name or text, and the files of its FMU without binaries."""
    spec = specs.loads(source) if "\n" in source else specs.load(resources.file_of(source))
    compilation = compile_proved(spec, **options).including("parameters")
    return compilation, unit_of(compilation, emit(compilation.program, "c", "phigen build"))


def compiled(files, folder, flags=("-O1",)):
    """Compile an FMU for this machine, and return the bytes of its shared library."""
    for file, text in files.sources.items():
        (folder / file).write_text(text, encoding="utf-8")
    output = folder / "unit.so"
    sources = [folder / file for file in files.sources if file.endswith(".c")]
    compiler = toolchain.find()
    toolchain.compile_library(sources, output, replace(compiler, tuning=(*FLAGS, *flags)))
    return output.read_bytes()


def written(source, folder, versions=(3, 2), **options):
    """Write the FMU of a spec for each version of FMI, and return the compilation and the paths by version."""
    compilation, files = unit(source, **options)
    library = {host().folder: compiled(files, folder)}
    paths = {v: folder / f"fmi{v}.fmu" for v in versions}
    for version, path in paths.items():
        path.write_bytes(archive(files, version, library))
    return compilation, paths


class Instance:
    """Initialised instance of an FMU in fmpy, whose variables are read and set by name."""

    def __init__(self, path, folder, start=0.0, stop=None, values=None, update=None, **options):
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        description = fmpy.read_model_description(path)
        target = folder / path.stem
        with zipfile.ZipFile(path) as file:
            file.extractall(target)
        self.version = int(description.fmiVersion[0])
        self.numbers = {v.name: v.valueReference for v in description.modelVariables}
        kind = FMU3Slave if self.version == 3 else FMU2Slave
        token = description.instantiationToken if self.version == 3 else description.guid
        identifier = description.coSimulation.modelIdentifier
        self.raw = kind(guid=token, unzipDirectory=str(target), modelIdentifier=identifier, instanceName="unit")
        if self.version == 3:
            self.raw.instantiate(intermediateUpdate=update, earlyReturnAllowed=update is not None, **options)
            self.set(values or {})
            self.raw.enterInitializationMode(startTime=start, stopTime=stop)
        else:
            self.raw.instantiate()
            self.raw.setupExperiment(startTime=start, stopTime=stop)
            self.set(values or {})
            self.raw.enterInitializationMode()
        self.raw.exitInitializationMode()

    def get(self, *names):
        """Return the values of the variables with these names."""
        get = self.raw.getFloat64 if self.version == 3 else self.raw.getReal
        return [float(v) for v in get([self.numbers[name] for name in names])]

    def set(self, values):
        """Set variables, given as a mapping of names to values."""
        put = self.raw.setFloat64 if self.version == 3 else self.raw.setReal
        put([self.numbers[name] for name in values], list(values.values()))

    def step(self, at, size):
        """Make a communication step from the time ``at``. For FMI 3, return its outcome."""
        return self.raw.doStep(currentCommunicationPoint=at, communicationStepSize=size)

    def end(self):
        """Terminate the instance and free its memory."""
        self.raw.terminate()
        self.raw.freeInstance()


@contextlib.contextmanager
def running(*arguments, **options):
    """Yield an `Instance`, which is freed at the end."""
    instance = Instance(*arguments, **options)
    try:
        yield instance
    finally:
        instance.end()
