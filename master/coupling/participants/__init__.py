"""What is coupled: an FMU or a solver core in this process, both behind one interface."""

from interface import SimulationEnded, StepDiscarded, StepFailed
from master.coupling.participants.fmu import FmuParticipant
from master.coupling.participants.in_process import InProcessParticipant
from master.coupling.participants.protocol import Participant

__all__ = ["FmuParticipant", "InProcessParticipant", "Participant", "SimulationEnded", "StepDiscarded", "StepFailed"]
