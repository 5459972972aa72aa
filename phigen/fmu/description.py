"""The XML of an FMU: ``modelDescription.xml`` of FMI 2.0 and 3.0, and the build description of FMI 3.0.

All text of the spec reaches the files through ElementTree, which escapes it.
"""

from __future__ import annotations

import unicodedata
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from phigen._version import __version__
from phigen.fmu.variables import Variable, first_run

if TYPE_CHECKING:
    from phigen.compilation import Compilation

#: Name of the vendor, under which ``modelDescription.xml`` stores annotations.
VENDOR = "phigen"

_HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
#: Names of the XML attributes in ``modelDescription.xml`` that state capabilities of the solver, by version of FMI.
_ABILITIES = {
    2: ("canHandleVariableCommunicationStepSize", "canGetAndSetFMUstate", "canSerializeFMUstate"),
    3: (
        "canHandleVariableCommunicationStepSize",
        "canGetAndSetFMUState",
        "canSerializeFMUState",
        "providesIntermediateUpdate",
        "canReturnEarlyAfterIntermediateUpdate",
        "hasEventMode",
    ),
}


def model_description(
    compilation: Compilation, variables: Sequence[Variable], token: str, version: int, sources: Sequence[str]
) -> str:
    """Return the text of ``modelDescription.xml`` for version 2 or 3 of FMI.

    ``token`` identifies the solver, so that the simulator notices a wrong library; ``sources`` are the C files to
    compile.
    """
    spec = compilation.spec
    variables = [
        replace(v, unit=_without_control_characters(v.unit), description=_without_control_characters(v.description))
        for v in variables
    ]
    root = ET.Element("fmiModelDescription", fmiVersion=f"{version}.0", modelName=spec.name)
    root.set("guid" if version == 2 else "instantiationToken", token)
    for key, text in {
        "description": _without_control_characters(spec.title) or _without_control_characters(spec.description),
        "license": _without_control_characters(spec.license),
    }.items():
        if text:
            root.set(key, text)
    root.set("generationTool", f"phigen {__version__}")
    root.set("variableNamingConvention", "structured")
    _co_simulation(root, compilation, version, sources)
    units = dict.fromkeys(v.unit for v in variables if v.unit)
    if units:
        defined = ET.SubElement(root, "UnitDefinitions")
        for unit in units:
            ET.SubElement(defined, "Unit", name=unit)
    categories = ET.SubElement(root, "LogCategories")
    ET.SubElement(categories, "Category", name="logStatusError", description="why a call failed")
    _experiment(root, compilation)
    if version == 2:
        _annotations(root, compilation, version)
    variables_element = ET.SubElement(root, "ModelVariables")
    for variable in variables:
        (_variable_2 if version == 2 else _variable_3)(variables_element, variable)
    _structure(root, variables, version)
    if version == 3:
        _annotations(root, compilation, version)
    return _text(root)


def build_description(name: str, sources: Sequence[str]) -> str:
    """Return the text of ``sources/buildDescription.xml`` for FMI 3.0; ``sources`` are the C files to compile."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=name)
    files = ET.SubElement(configuration, "SourceFileSet", language="C99")
    for source in sources:
        ET.SubElement(files, "SourceFile", name=source)
    return _text(root)


def _co_simulation(root: ET.Element, compilation: Compilation, version: int, sources: Sequence[str]) -> None:
    of_steps = ET.SubElement(root, "CoSimulation", modelIdentifier=compilation.spec.name)
    for ability in _ABILITIES[version]:
        of_steps.set(ability, "true")
    if compilation.program.noise:  # A step with noise cannot be divided: its parts would draw other random numbers.
        of_steps.set("canHandleVariableCommunicationStepSize", "false")
    if version == 2:
        of_steps.set("canNotUseMemoryManagementFunctions", "true")
        files = ET.SubElement(of_steps, "SourceFiles")
        for source in sources:
            ET.SubElement(files, "File", name=source)


def _experiment(root: ET.Element, compilation: Compilation) -> None:
    """Add the default experiment, with start, end and step of `first_run`, to the XML element ``root``.

    With a monitor, which rescales the time, the end in physical time is unknown, so only the start is added.
    """
    run = first_run(compilation.spec)
    experiment = ET.SubElement(root, "DefaultExperiment", startTime=repr(float(run.start)))
    if compilation.program.monitor is None:
        experiment.set("stopTime", repr(float(run.start + run.step * run.steps)))
        experiment.set("stepSize", repr(float(run.step * run.stride)))


def _annotations(root: ET.Element, compilation: Compilation, version: int) -> None:
    """Add annotations to the XML element ``root``: the method of the solver, and the checksum of its spec."""
    spec, facts = compilation.spec, ET.Element("method")
    facts.set("order", str(compilation.order.order))
    facts.set("scheme", str(compilation.described["scheme"]))
    facts.set("label", _without_control_characters(compilation.label))
    facts.set("profile", compilation.program.profile)
    facts.set("specSha256", spec.source_sha256)
    if version == 2:
        ET.SubElement(ET.SubElement(root, "VendorAnnotations"), "Tool", name=VENDOR).append(facts)
    else:
        ET.SubElement(ET.SubElement(root, "Annotations"), "Annotation", type=VENDOR).append(facts)


def _variable_3(variables_element: ET.Element, variable: Variable) -> None:
    element = ET.SubElement(variables_element, "Int32" if variable.whole else "Float64", _common(variable))
    _values(element, variable)


def _variable_2(variables_element: ET.Element, variable: Variable) -> None:
    scalar = ET.SubElement(variables_element, "ScalarVariable", _common(variable))
    _values(ET.SubElement(scalar, "Integer" if variable.whole else "Real"), variable)


def _common(variable: Variable) -> dict[str, str]:
    attributes = {"name": variable.name, "valueReference": str(variable.number)}
    attributes |= {"description": variable.description} if variable.description else {}
    attributes |= {"causality": variable.causality, "variability": variable.variability}
    return attributes | ({"initial": variable.initial} if variable.initial else {})


def _values(element: ET.Element, variable: Variable) -> None:
    if variable.unit:
        element.set("unit", variable.unit)
    if variable.positive:
        element.set("min", "0.0")
    if variable.start is not None:
        element.set("start", str(variable.start) if variable.whole else repr(float(variable.start)))


def _structure(root: ET.Element, variables: Sequence[Variable], version: int) -> None:
    structure = ET.SubElement(root, "ModelStructure")
    outputs = [v for v in variables if v.causality == "output"]
    computed = [v for v in outputs if v.initial == "calculated"]
    if version == 3:
        for kind, unknowns in (("Output", outputs), ("InitialUnknown", computed)):
            for v in unknowns:
                ET.SubElement(structure, kind, valueReference=str(v.number))
        return
    for kind, unknowns in (("Outputs", outputs), ("InitialUnknowns", computed)):
        group = ET.SubElement(structure, kind)
        for v in unknowns:
            ET.SubElement(group, "Unknown", index=str(v.number + 1))


def _without_control_characters(text: str) -> str:
    """Return the text on one line and without control characters, which XML forbids."""
    return " ".join(
        "".join(" " if unicodedata.category(c) in ("Cc", "Cs", "Cn", "Zl", "Zp") else c for c in text).split()
    )


def _text(root: ET.Element) -> str:
    ET.indent(root)
    return _HEAD + ET.tostring(root, encoding="unicode") + "\n"
