"""Runs of scenes in motion: both solvers through time, communication step by communication step."""

from master.transient.simulation import Simulation, simulate

__all__ = ["Simulation", "simulate"]
