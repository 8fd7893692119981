"""The 3D panel method: attached potential flow around closed bodies of quadrilateral and triangular panels.

Perturbation potentials: phi = -(sigma / 4 pi) int dS / r of a source density sigma, and
phi = -(mu / 4 pi) int (P - Q).n / r^3 dS of a doublet density mu whose axis is the outward normal n
(Katz and Plotkin 2001, ch. 3 and 10).
"""
