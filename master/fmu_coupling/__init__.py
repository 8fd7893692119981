"""FMUs of any maker, coupled as a file says: the file and its checks, names of variables, runs and their results."""

from master.fmu_coupling.document import Document
from master.fmu_coupling.results import CoupleResult
from master.fmu_coupling.run import couple, opened

__all__ = ["CoupleResult", "Document", "couple", "opened"]
