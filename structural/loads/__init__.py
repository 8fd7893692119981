"""What loads act on: faces under pressure, lines under a load per length, legs in the wind, behind one contract."""

from .contract import LoadGroup
from .faces import FaceLoad, Faces
from .legs import Legs, LineLoad, Lines, Wind

__all__ = ["FaceLoad", "Faces", "Legs", "LineLoad", "Lines", "LoadGroup", "Wind"]
