"""The verdict on validity in the table of a run."""

from collections.abc import Sequence

from master.coupling.validity import Judgement


def validity_row(found: Sequence[Judgement]) -> tuple[str, str]:
    """What lies outside its limit, a line each; or that nothing does, and which element or strip comes closest."""
    outside = [j for j in found if not j.within]
    if outside:
        return "validity", "outside: " + ";\n".join(j.text for j in outside)
    many = [j for j in found if j.criterion.labels and j.criterion.limit > 0.0]
    near = max(many, key=lambda j: j.value / j.criterion.limit, default=None)
    if near is None:
        return "validity", "within" if found else "not judged: no step was completed, or no model here has limits"
    return "validity", f"within; closest: {near.text}"
