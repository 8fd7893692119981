"""Packages of System Structure and Parameterization (SSP) 1.0 as couplings of FMUs."""

from master.fmu_coupling.ssp.content import Package, opened_package

__all__ = ["Package", "opened_package"]
