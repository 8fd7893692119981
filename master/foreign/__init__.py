"""FMUs of any maker, coupled as a file says: the file and its checks, names of variables, runs and their results."""

from master.foreign.document import Document
from master.foreign.run import CoupleResult, couple, opened

__all__ = ["CoupleResult", "Document", "couple", "opened"]
