"""Panel method: attached potential flow around closed bodies of quads and triangles."""
