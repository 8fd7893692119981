"""Kratos as a peer: it is loaded when first asked for, and its convergence accelerators are schemes of `fixed_point`,
so that both meet the same test.

Kratos (BSD) is an extra: pip install -c constraints.txt -e '.[peers]'
"""

import contextlib
import functools
import importlib
import json
import os
import sys
from importlib import metadata

import numpy as np

NOT_INSTALLED = "Kratos is not installed"
INSTALL = "pip install -c constraints.txt -e '.[peers]'"


def version():
    """Version of KratosCoSimulationApplication, None where it is not installed."""
    try:
        return metadata.version("KratosCoSimulationApplication")
    except metadata.PackageNotFoundError:
        return None


def has(*packages):
    """Whether applications of Kratos are installed, by names such as StructuralMechanicsApplication."""
    try:
        for package in packages:
            metadata.version(f"Kratos{package}")
    except metadata.PackageNotFoundError:
        return False
    return True


def loaded(*packages):
    """Kratos' core with these applications, without its banners and with warnings only; ModuleNotFoundError in a
    sentence where one is not installed.
    """
    if not has(*packages):
        raise ModuleNotFoundError(f"{NOT_INSTALLED}; {INSTALL} brings it.")
    with _silence():
        core = importlib.import_module("KratosMultiphysics")
        for package in packages:
            importlib.import_module(f"KratosMultiphysics.{package}")
    core.Logger.GetDefaultOutput().SetSeverity(core.Logger.Severity.WARNING)
    return core


class KratosAccelerator:
    """A convergence accelerator of Kratos with its settings, by the name of its type: iqnils, mvqn, aitken, ...

    The calls come in the order of Kratos' GaussSeidelStrongCoupledSolver: InitializeSolutionStep; in every coupling
    iteration InitializeNonLinearIteration, the solvers, FinalizeNonLinearIteration, the test, and unless it holds
    UpdateSolution(r, x), whose result is added to x; FinalizeSolutionStep. As there, an accelerator does not see the
    pair that converged. With `separately` every field has an accelerator of its own, as every interface data has in
    Kratos; else one takes all fields as one vector.

    A singular matrix in Kratos ends the coupling loop as diverged.
    """

    def __init__(self, kind, separately=False, **settings):
        self.kind, self.separately, self.settings = kind, separately, settings
        self._create = functools.partial(_creator(kind), settings)
        self._accelerators = None
        self._fields = (slice(None),)

    def __str__(self):
        own = "; an accelerator a field" if self.separately else ""
        return f"{self.kind} {', '.join(f'{k} {v:g}' for k, v in self.settings.items())}{own}"

    def begin(self, fields):
        self._fields = tuple(fields) if self.separately else (slice(None),)
        if self._accelerators is None:
            self._accelerators = [self._create() for _ in self._fields]
            self._all("Initialize")
        self._all("InitializeSolutionStep")
        self._all("InitializeNonLinearIteration")

    def step(self, x, r):
        """Next x, same shape and unit."""
        self._all("FinalizeNonLinearIteration")
        x_next = np.array(x)
        for accelerator, f in zip(self._accelerators, self._fields, strict=True):
            try:
                x_next[f] += accelerator.UpdateSolution(np.array(r[f]), np.array(x[f]))
            except np.linalg.LinAlgError:
                x_next[f] = np.nan
        self._all("InitializeNonLinearIteration")
        return x_next

    def end(self, status, x, r):
        self._all("FinalizeNonLinearIteration")
        self._all("FinalizeSolutionStep")

    def _all(self, call):
        for accelerator in self._accelerators:
            getattr(accelerator, call)()


def _creator(kind):
    """settings -> accelerator, from Kratos' module of that name."""
    if version() is None:
        raise ModuleNotFoundError(f"{NOT_INSTALLED}; {INSTALL} brings it.")
    core = loaded("CoSimulationApplication")
    with _silence():
        module = importlib.import_module(f"KratosMultiphysics.CoSimulationApplication.convergence_accelerators.{kind}")
    return lambda settings: module.Create(core.Parameters(json.dumps({"type": kind, **settings})))


@contextlib.contextmanager
def _silence():
    """No banner: Kratos writes it to the file descriptor of standard output as it loads."""
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
            os.dup2(nowhere.fileno(), 1)
            yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
