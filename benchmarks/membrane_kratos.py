"""The airbag in the membrane elements of Kratos: relaxed there from flat, and its forces in our equilibrium.

Kratos (BSD): MembraneElement3D3N with WrinklingLinear2DLaw over LinearElasticPlaneStress2DLaw, and
SurfaceLoadCondition3D3N with a pressure that follows; the same nodes, triangles and supports as ours, nothing else of
ours. For an isotropic fabric its law, which keeps the tension along the larger principal stress, is the tension field
of `materials.membranes`. Its tangent leaves out that the tension turns, so Newton's method with it comes to the
equilibrium linearly, and only from near by. So the shape is found by kinetic dynamic relaxation, which asks for forces
only (Barnes 1999; ram-air thesis 3.4).
"""

import time
from dataclasses import dataclass

import numpy as np

from . import kratos
from .membrane_models import AIRBAG_FABRIC, airbag, inflated, principal
from .registry import Table
from .text import lines, table

PRESSURE = 5000.0  # Pa
PACKAGES = ("StructuralMechanicsApplication", "ConstitutiveLawsApplication", "LinearSolversApplication")
# A relaxation ends at this residual over the load: the height then changes by less than 1e-3 mm.
RELAXED, MOST_STEPS, CHECK = 1e-5, 100_000, 50
# How far from equilibrium Kratos' own Newton iterations start, m, and after how many they are judged.
NEAR, LINEAR = 1e-6, 20
# Cells along a side of the meshes, and up to how many triangles they are relaxed: steps take longer on finer meshes,
# and more of them are needed.
CELLS, RELAXED_UP_TO = (2, 4, 6, 10, 50), 400


class KratosAirbag:
    """An airbag of `airbag(n)` as a model part of Kratos: forces and Newton iterations at displacements (n,3) m."""

    def __init__(self, nodes, fixed, triangles, pressure):
        self.core = core = kratos.loaded(*PACKAGES)
        self._model = core.Model()
        self._part = part = self._model.CreateModelPart("airbag")
        self._free = ~fixed
        part.ProcessInfo[core.DOMAIN_SIZE] = 3
        for variable in (core.DISPLACEMENT, core.REACTION, core.VOLUME_ACCELERATION):
            part.AddNodalSolutionStepVariable(variable)
        for number, point in enumerate(nodes.tolist()):
            part.CreateNewNode(number + 1, *point)
        fabric = self._fabric()
        for number, corners in enumerate((triangles + 1).tolist()):
            part.CreateNewElement("MembraneElement3D3N", number + 1, corners, fabric)
            face = part.CreateNewCondition("SurfaceLoadCondition3D3N", number + 1, corners, fabric)
            face.SetValue(core.NEGATIVE_FACE_PRESSURE, pressure)
        self._support(fixed)
        self._builder, self._scheme = self._system()
        self._builder.SetUpDofSet(self._scheme, part)
        self._builder.SetUpSystem(part)
        for entity in (*part.Elements, *part.Conditions):
            entity.Initialize(part.ProcessInfo)
        self._space = core.UblasSparseSpace()
        self._sum = self._space.CreateEmptyVectorPointer()
        self._space.ResizeVector(self._sum, nodes.size)

    def _system(self):
        """Builder and scheme of a static problem; forces and Newton iterations have their own."""
        core = self.core
        solver = core.LinearSolversApplication.SparseLUSolver()
        return core.ResidualBasedBlockBuilderAndSolver(solver), core.ResidualBasedIncrementalUpdateStaticScheme()

    def _fabric(self):
        """Properties of the wrinkling law, which has the elastic one as sub-properties."""
        core, part = self.core, self._part
        law = core.KratosGlobals.GetConstitutiveLaw
        fabric, elastic = part.CreateNewProperties(1), core.Properties(2)
        modulus, thickness, nu = AIRBAG_FABRIC
        for properties, name in ((elastic, "LinearElasticPlaneStress2DLaw"), (fabric, "WrinklingLinear2DLaw")):
            properties[core.YOUNG_MODULUS], properties[core.POISSON_RATIO] = modulus, nu
            properties[core.THICKNESS], properties[core.DENSITY] = thickness, 1.0
            properties[core.CONSTITUTIVE_LAW] = law(name).Clone()
        fabric.AddSubProperties(elastic)
        return fabric

    def _support(self, fixed):
        core, part = self.core, self._part
        axes = [(getattr(core, f"DISPLACEMENT_{a}"), getattr(core, f"REACTION_{a}")) for a in "XYZ"]
        for displacement, reaction in axes:
            core.VariableUtils().AddDof(displacement, reaction, part)
        for node, held in zip(part.Nodes, fixed, strict=True):
            for (displacement, _), fix in zip(axes, held, strict=True):
                if fix:
                    node.Fix(displacement)

    def place(self, displacements):
        """Move the nodes by displacements (n,3) m from where they were made."""
        core, part = self.core, self._part
        tools = core.VariableUtils()
        tools.SetSolutionStepValuesVector(part.Nodes, core.DISPLACEMENT, core.Vector(displacements.reshape(-1)), 0)
        tools.UpdateCurrentPosition(part.Nodes)

    def forces(self, displacements):
        """External minus internal forces (n,3) N, zero in supported directions."""
        self.place(displacements)
        self._space.SetToZeroVector(self._sum)
        self._builder.BuildRHS(self._scheme, self._part, self._sum)
        return np.where(self._free, np.array(self._sum).reshape(-1, 3), 0.0)

    def load(self, displacements):
        """Norm N of the external forces in free directions."""
        self.place(displacements)
        total, own = np.zeros(self._free.shape), self.core.Vector()
        for face in self._part.Conditions:
            face.CalculateRightHandSide(own, self._part.ProcessInfo)
            total[[node.Id - 1 for node in face.GetNodes()]] += np.array(own).reshape(-1, 3)
        return float(np.linalg.norm(total[self._free]))

    def stress_at_centre(self, displacements):
        """Larger principal stress Pa (2nd Piola-Kirchhoff) that Kratos has in the elements at the first node, mean."""
        self.place(displacements)
        variable, info = self.core.StructuralMechanicsApplication.PRINCIPAL_PK2_STRESS_VECTOR, self._part.ProcessInfo
        around = [e for e in self._part.Elements if any(node.Id == 1 for node in e.GetNodes())]
        return float(np.mean([e.CalculateOnIntegrationPoints(variable, info)[0][0] for e in around]))

    def newton(self, displacements, iterations):
        """Norms N of what is out of balance before and after each of Kratos' own Newton iterations."""
        core, part = self.core, self._part
        criterion = core.ResidualCriteria(0.0, 0.0)
        builder, scheme = self._system()
        newton = core.ResidualBasedNewtonRaphsonStrategy(part, scheme, criterion, builder, 1, False, False, True)
        for talkative in (criterion, newton):
            talkative.SetEchoLevel(0)
        newton.Initialize()
        norms = [float(np.linalg.norm(self.forces(displacements)))]
        for _ in range(iterations):
            newton.InitializeSolutionStep()
            newton.Predict()
            newton.SolveSolutionStep()
            newton.FinalizeSolutionStep()
            u = core.VariableUtils().GetSolutionStepValuesVector(part.Nodes, core.DISPLACEMENT, 0, 3)
            norms.append(float(np.linalg.norm(self.forces(np.array(u).reshape(-1, 3)))))
        return norms


@dataclass(frozen=True, eq=False)
class Relaxed:
    """Where a relaxation has come to: displacements (n,3) m, residual over load, steps, and its status."""

    displacements: np.ndarray
    residual: float
    steps: int
    status: str


def relaxed(bag, group, start):
    """Kinetic dynamic relaxation of a `KratosAirbag` from displacements (n,3) m: steps of 1 with masses for which that
    is stable whatever is taut, velocities set to zero where the kinetic energy has passed a peak.
    """
    masses = relaxation_masses(group, len(start))
    u, v = start.copy(), np.zeros_like(start)
    f, before = bag.forces(u), 0.0
    for step in range(MOST_STEPS):
        if step % CHECK == 0:
            residual = float(np.linalg.norm(f)) / bag.load(u)
            if not residual > RELAXED:
                return Relaxed(u, residual, step, "converged")
        v += f / masses
        kinetic = float(np.sum(masses * v * v))
        if kinetic < before:
            u -= 0.5 * v  # about where the peak was
            v[:] = kinetic = 0.0
        else:
            u += v
        before, f = kinetic, bag.forces(u)
    return Relaxed(u, residual, MOST_STEPS, "max_steps")


def relaxation_masses(group, count):
    """Half of a bound (n,1) N/m of the row sums of the stiffness of taut triangles (Gershgorin)."""
    slopes, weights = group.geometry
    size = np.sqrt(np.sum(slopes[0] ** 2, axis=1))  # (m, e)
    bound = np.zeros(count)
    np.add.at(bound, group.nodes.T, group.law.stiffest * weights[0] * size * size.sum(axis=0))
    return 0.5 * bound[:, None]


def height_and_stress(group, x):
    """Height mm of the centre and the larger principal stress there, MPa."""
    at_centre = principal(group, x)[0, 0, (group.nodes == 0).any(axis=1)]
    return 1e3 * float(x[0, 2]), 1e-6 * float(at_centre.mean()) / AIRBAG_FABRIC[1]


def _row(n):
    """Cells of a table row."""
    nodes, fixed, group = airbag(n)
    begin = time.process_time()
    own, _, _ = inflated(nodes, fixed, group, PRESSURE)
    seconds = time.process_time() - begin
    bag, u = KratosAirbag(nodes, fixed, group.nodes, PRESSURE), own.x - nodes
    w, s = height_and_stress(group, own.x)
    left = float(np.linalg.norm(bag.forces(u))) / bag.load(u)
    row = [len(group), own.status, own.iterations, f"{seconds:.2f}", f"{w:.2f}", f"{s:.4f}"]
    row += [f"{left:.1e}", f"{1e-6 * bag.stress_at_centre(u):.4f}"]
    if len(group) > RELAXED_UP_TO:
        return [*row, "left out", *[""] * 5]
    norms = np.array(bag.newton(u + np.where(fixed, 0.0, NEAR * np.random.default_rng(1).normal(size=u.shape)), LINEAR))
    begin = time.process_time()
    theirs = relaxed(bag, group, np.zeros_like(nodes))
    took = time.process_time() - begin
    row += [theirs.status, theirs.steps, f"{took:.1f}", f"{1e3 * theirs.displacements[0, 2]:.2f}"]
    return [*row, f"{1e-6 * bag.stress_at_centre(theirs.displacements):.4f}", f"{(norms[-1] / norms[-6]) ** 0.2:.2f}"]


def airbag_in_kratos(quick):
    """Height, stress, iterations and time of the airbag, ours and in Kratos, side by side."""
    if not kratos.has(*PACKAGES):
        return f"{kratos.NOT_INSTALLED}; `{kratos.INSTALL}` brings it."
    rows = [_row(n) for n in (CELLS[:2] if quick else CELLS)]
    names = ["triangles", "status", "Newton iterations", "time, s", "height, mm", "S1 at the centre, MPa"]
    names += ["residual of Kratos there, over the load", "S1 of Kratos there, MPa", "relaxation in Kratos", "steps"]
    names += ["time, s", "height, mm", "S1, MPa", "residual after over before a Newton iteration of Kratos"]
    return lines(
        table(names, rows),
        f"The airbag of `membranes.airbag` from flat, and in MembraneElement3D3N of Kratos {kratos.version()} with "
        "WrinklingLinear2DLaw and a pressure that follows, processor time on one thread. Seventh and eighth column: "
        "what the elements of Kratos leave out of balance in our equilibrium, over the load, and the stress that they "
        f"have there. Then, up to {RELAXED_UP_TO} triangles, kinetic dynamic relaxation from flat on the forces of "
        f"Kratos down to {RELAXED:g} of the load; of ours are only the masses, which set the steps. Kratos' own "
        "ResidualBasedNewtonRaphsonStrategy and LineSearchStrategy diverge from flat or nearly flat; the last column "
        f"is what each of its iterations leaves of the residual {1e6 * NEAR:g} µm from equilibrium: its tangent does "
        "not know that the tension of wrinkled fabric turns.",
    )


ENTRIES = (
    Table(
        name="membranes.kratos",
        title="Square airbag in our membranes and in those of Kratos",
        build=airbag_in_kratos,
    ),
)
