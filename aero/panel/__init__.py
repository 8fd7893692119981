"""The panel method: sources and doublets on closed bodies in a stream, and the wakes that their trailing edges leave."""
