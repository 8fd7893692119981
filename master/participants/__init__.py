"""What is coupled: an FMU or a solver core in this process, both behind one interface."""

from interface import StepFailed
from master.participants.fmu import FmuParticipant
from master.participants.in_process import InProcessParticipant
from master.participants.protocol import Participant

__all__ = ["FmuParticipant", "InProcessParticipant", "Participant", "StepFailed"]
