"""What the structural core of a scene shows to the outside: inputs, parameters and outputs."""

from functools import partial

from interface import Variable

from .heading import azimuth_variables

tunable = partial(Variable, causality="parameter", variability="tunable")
fixed = partial(Variable, causality="parameter", variability="fixed")
output = partial(Variable, causality="output")
switch = partial(tunable, kind="boolean", minimum=0.0, maximum=1.0)
whole = partial(output, kind="integer")
STRAIN = "elongation of the element over its rest length, negative where slack"


def static_variables(scene, model):
    """The variables of a quasi-static structure, one by one."""
    yield from _loads(scene)
    yield from _parameters(scene, model)
    yield from _solution(scene)
    text = "force per way that holds nodes back in a step (a step in pseudo-time); 0: it ends in equilibrium"
    yield tunable("pseudo_damping", unit="N/m", minimum=0.0, maximum=1e12, description=text)
    yield from _shape(scene)
    yield from _holding(scene)
    yield whole("slack_lines", description="lines without tension")
    yield output("residual", unit="N", description="out-of-balance force over free dofs after the step")
    text = "out-of-balance force of the state before the step under the loads of the step"
    yield output("imbalance_before_step", unit="N", description=text)
    yield whole("newton_iterations", description="Newton iterations of the step")
    text = "directions in which the equilibrium is unstable under its loads, kept as they are"
    yield whole("unstable_modes", description=text)
    yield _symmetry_used(scene, model)
    yield from _of_elements(scene, model)
    if model.membranes is not None:
        yield from model.membranes.outputs()
    yield from model.validity_variables()
    yield from azimuth_variables(scene)


def transient_variables(scene, model):
    """The variables of a transient structure, one by one."""
    yield from _loads(scene)
    yield from _parameters(scene, model)
    yield from _motion(scene, model)
    yield from _solution(scene)
    yield from _shape(scene)
    yield from _holding(scene)
    yield whole("slack_lines", description="lines without tension")
    yield from _energies(scene, model)
    yield whole("integration_steps", description="steps of the integration in the last step")
    yield whole("newton_iterations", description="Newton iterations of the step")
    yield _symmetry_used(scene, model)
    yield from _of_elements(scene, model)
    yield from model.validity_variables()
    yield from azimuth_variables(scene)


def _loads(scene):
    interface, panels = scene.interface, len(scene.interface.panels)
    of_panel = partial(Variable, counts="panel")
    if "pressure" in scene.loads:
        text = "pressure along the normal of each interface panel, follower"
        yield of_panel("pressure", (panels,), unit="Pa", description=text)
    if "shear" in scene.loads:
        text = "traction on each interface panel, keeps its global direction"
        yield of_panel("shear", (panels, 3), unit="Pa", description=text)
    if "line_load" in scene.loads:
        text = "wind load on each exposed line per current length, keeps its global direction"
        yield Variable("line_load", (len(interface.lines), 3), unit="N/m", description=text, counts="line")


def _parameters(scene, model):
    given, m = scene.structure, scene.members
    text = "gravity, towards -z"
    yield tunable("gravity", unit="m/s2", start=given.gravity, minimum=-1e3, maximum=1e3, description=text)
    if given.line_modulus:
        text = "Young's modulus of the bridle lines"
        yield tunable("line_modulus", unit="Pa", start=given.line_modulus, minimum=1e3, description=text)
    for parameter, start in model.tapes.starts.items():
        of = "rest length of " if parameter in given.tapes else "rest length of all together: "
        text = of + ", ".join({**given.tapes, **given.reels}[parameter])
        yield tunable(parameter, unit="m", start=start, minimum=1e-3, description=text)
    if m.wing is not None:
        text = "pressure in the tubes above that of the air"
        start = given.tube_pressure
        yield tunable("tube_pressure", unit="Pa", start=start, minimum=100.0, maximum=3e5, description=text)
    if model.membranes is not None:
        yield from model.membranes.variables()
    for load in scene.point_loads:
        nodes = ", ".join(m.labels[n] for n in load.nodes)
        text = f"dead load on each of the nodes {nodes}, in the directions of the scene's table"
        yield tunable(load.name, unit="N", start=load.start, description=text)
    if given.hold is not None:
        text = "hold roll and yaw: side force and yawing moment on a node, reported as reactions"
        yield switch("hold_roll_and_yaw", description=text)
    if m.wing_mass.sum() > 0.0:
        text = "mass of springs and canopy together; their nodes' shares scale with it"
        yield tunable("wing_mass", unit="kg", start=m.wing_mass.sum(), minimum=0.0, description=text)


def _motion(scene, model):
    """Inputs and parameters of the time integration."""
    dynamics = scene.dynamics
    for tape in model.tapes.starts:
        text = f"rate at which the rest length of {tape} grows by reeling, on top of changes of {tape} itself"
        yield Variable(f"{tape}_rate", unit="m/s", minimum=-1e3, maximum=1e3, description=text)
    text = "longest step of the integration within a communication step"
    yield tunable("longest_step", unit="s", start=dynamics.longest_step, minimum=1e-7, description=text)
    text = "what a step leaves of oscillations that it does not resolve, 0 to 1 (generalised-alpha only)"
    start = dynamics.spectral_radius
    yield tunable("spectral_radius", start=start, minimum=0.0, maximum=1.0, description=text)
    for name, of in (("line_damping_time", "lines"), ("spring_damping_time", "springs and canopy")):
        text = f"damping over stiffness of {of} (Kelvin-Voigt)"
        yield tunable(name, unit="s", start=getattr(dynamics, name), minimum=0.0, maximum=1e3, description=text)
    text = "loads go linearly from those of the step before to the present ones; else the present ones act all along"
    yield switch("loads_vary", start=1.0, description=text)
    text = "begin at rest in the equilibrium under the loads of the first step, not in the shape of the tables"
    start = float(dynamics.start_in_equilibrium)
    yield fixed("start_in_equilibrium", kind="boolean", minimum=0.0, maximum=1.0, start=start, description=text)
    if len(scene.interface.panels):
        text = "air that the wing moves with it, over that of a flat plate across its chord (rho pi c^2 / 4 per span)"
        yield tunable("added_mass_coefficient", minimum=0.0, maximum=1e3, description=text)
        text = "density of the air that moves with the wing"
        start = 1.225 if scene.aero is None else scene.aero.air_density
        yield tunable("air_density", unit="kg/m3", start=start, minimum=1e-6, maximum=2e3, description=text)


def _solution(scene):
    text = "solve one half and mirror it; asymmetric input turns it off (see symmetry_used)"
    yield switch("symmetric", start=float(scene.structure.symmetric), description=text)
    text = "largest out-of-balance force that counts as equilibrium"
    text += "; with membranes no more than 1e-9 of the loads" if scene.members.membranes is not None else ""
    yield tunable("solver_tolerance", unit="N", start=1e-6, minimum=1e-12, description=text)
    if scene.trim is not None:
        text = "rigid nose-up rotation about the pivot in which the structure starts"
        yield fixed("trim_angle", unit="rad", minimum=-3.2, maximum=3.2, description=text)


def _shape(scene):
    m, points = scene.members, len(scene.interface.nodes)
    text = "interface displacement from the reference configuration"
    yield output("displacement", (points, 3), unit="m", description=text, counts="interface node")
    of_node = partial(output, labels=tuple(f"node {label}" for label in m.labels), counts="structural node")
    yield of_node("position", m.nodes.shape, unit="m", start=m.nodes, description="position")
    of_element = partial(output, labels=m.names, counts="element")
    yield of_element("tension", (len(m.names),), unit="N", description="tension")
    text = "force of the structure on its supports"
    yield output("support_force", (3,), unit="N", description=text)
    if m.wing is None:
        return
    yield of_element("strain", (len(m.names),), description=STRAIN)
    of_tube = partial(output, shape=(len(m.wing.tubes.names),), labels=m.wing.tubes.names, counts="tube")
    yield of_tube("tube_load", description="largest bending moment over the collapse moment")
    yield of_tube("tube_strain", description="strain of the fabric by normal force and bending")
    yield whole("collapsed_tubes", description="parts of tubes past their collapse moment")


def _holding(scene):
    if scene.structure.hold is not None:
        text = f"moment about the {'origin' if scene.pivot is None else 'pivot'} that holds roll and yaw"
        yield output("holding_moment", (3,), unit="N.m", description=text)
        yield output("holding_force", unit="N", description="side force (y) that holds roll and yaw")


def _energies(scene, model):
    points = len(scene.interface.nodes)
    text = "velocity of the interface nodes"
    yield output("velocity", (points, 3), unit="m/s", description=text, counts="interface node")
    for tape, start in model.tapes.starts.items():
        text = f"rest length of {tape} at the end of the step, reeling included"
        yield output(f"{tape}_present", unit="m", start=start, description=text)
    for name, text in (
        ("kinetic_energy", "of all nodes"),
        ("elastic_energy", "of all elements"),
        ("external_work", "put in by loads and gravity since the beginning"),
        ("reeling_work", "put in by changes of rest length since the beginning"),
        ("dissipated_energy", "taken by dampers since the beginning"),
        ("numerical_loss", "missing from the balance since the beginning: what the scheme damps, or makes if negative"),
    ):
        yield output(name, unit="J", description=text)


def _symmetry_used(scene, model):
    start = float(scene.structure.symmetric and model.mirror is not None)
    return output("symmetry_used", kind="boolean", start=start, description="whether the last solve was of one half")


def _of_elements(scene, model):
    """Last of all, so that what came before them keeps its place."""
    names, wing = scene.members.names, scene.members.wing
    of_element = partial(output, shape=(len(names),), labels=names, counts="element")
    yield of_element("rest_length", unit="m", start=model.tapes.rest_lengths, description="rest length")
    yield of_element("length", unit="m", description="length, over all legs of a rope")
    if wing is None:
        yield of_element("strain", description=STRAIN)
    text = "stiffness times rest length, EA: the tension over the strain where it is taut; 0 without a rest length"
    yield of_element("axial_stiffness", unit="N", description=text)
    if wing is not None:
        of_tube = partial(output, shape=(len(wing.tubes.names),), labels=wing.tubes.names, counts="tube", unit="m")
        yield of_tube("tube_rest_length", description="rest length")
        yield of_tube("tube_length", description="distance between its ends")
