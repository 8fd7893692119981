"""An FMI 3.0 model description: every block is one array variable."""

from xml.etree.ElementTree import Element, SubElement

from fmus.adapter import CoreFmu
from fmus.description import attributes_of, describe_model, unit_definitions

CAPABILITIES = (
    "needsExecutionTool",
    "canGetAndSetFMUState",
    "canSerializeFMUState",
    "canHandleVariableCommunicationStepSize",
)
TYPES = {"real": "Float64", "integer": "Int32", "boolean": "Boolean"}


def array_description(instance: CoreFmu, token: str) -> Element:
    """The model description of `instance` with the instantiation token.

    The value reference of a variable is the place of its first scalar in the buffer. Dependencies are those of FMI 2.0:
    at a communication point none, and in initialization mode what has a causality of `at_start`.
    """
    name = str(instance.modelName)
    root = Element("fmiModelDescription", {"fmiVersion": "3.0", "modelName": name, "instantiationToken": token})
    root.attrib |= {"description": instance.description or "", "variableNamingConvention": "structured"}
    describe_model(root)
    SubElement(root, "CoSimulation", {"modelIdentifier": name} | dict.fromkeys(CAPABILITIES, "true"))
    variables = [variable for variable, _ in instance.blocks.values()]
    root.append(unit_definitions(variables))
    categories = SubElement(root, "LogCategories")
    for category, description in instance.log_categories.items():
        SubElement(categories, "Category", name=category, description=description)
    times = type(instance).default_experiment
    SubElement(
        root,
        "DefaultExperiment",
        startTime=str(times.start_time),
        stopTime=str(times.stop_time),
        stepSize=str(times.step_size),
    )
    listed, structure = SubElement(root, "ModelVariables"), SubElement(root, "ModelStructure")
    known: list[tuple[str, str]] = []
    outputs: list[tuple[str, str]] = []
    for variable, where in instance.blocks.values():
        attributes, limits, text = attributes_of(variable)
        identity = {"name": variable.name, "valueReference": str(where.start)}
        identity |= {"description": variable.description} if variable.description else {}
        if variable.causality != "output":
            limits["start"] = " ".join(map(text, instance.start(variable.name)))
        element = SubElement(listed, TYPES[variable.kind], identity | attributes | limits)
        for length in variable.shape:
            SubElement(element, "Dimension", start=str(length))
        (outputs if variable.causality == "output" else known).append((variable.causality, str(where.start)))
    now = {"name": "time", "valueReference": str(sum(v.size for v in variables)), "causality": "independent"}
    SubElement(listed, "Float64", now | {"variability": "continuous", "description": "time"})
    everything = {"parameter", "input"} <= set(instance.at_start)  # then nothing need be listed
    followed = " ".join(reference for causality, reference in known if causality in instance.at_start)
    for tag, dependencies in (("Output", ""), ("InitialUnknown", followed)):
        for _, reference in outputs:
            listing = {} if everything and tag == "InitialUnknown" else {"dependencies": dependencies}
            SubElement(structure, tag, {"valueReference": reference} | listing)
    return root
