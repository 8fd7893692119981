"""Tables 8.1 and 8.3 of the PSM thesis: form finding of three cases, four sizes, four stiffnesses, four ways."""

import statistics
import time

from structural.dynamics import METHODS, form_finding

from .particle_models import blown, hanging, net
from .registry import Table
from .text import lines, table

CASES = {"b2": hanging, "b3": lambda n, k, c: blown(n, k, c, law="projected"), "b4": net}
SIZES, STIFFNESSES = (13, 41, 85, 181), (1.0, 100.0, 6e4, 1e6)
NA, UNREAD = None, float("nan")  # the last row of table 8.1 is missing in the copy at hand
# Seconds of the thesis on its laptop, None where it has N/A: [damping of table 8.1 or 8.3][method][k] are rows of sizes
# with b2, b3, b4.
THESIS = {
    1.0: {
        "viscous": {
            1.0: ((0.051, NA, 0.053), (0.489, 0.650, 0.308), (2.454, 1.828, 1.444), (10.366, 3.110, 3.533)),
            100.0: ((1.068, NA, 0.375), (0.216, 0.643, 0.138), (0.328, 1.035, 0.320), (10.433, 5.098, 0.607)),
            6e4: ((1.117, 0.633, 0.073), (0.487, 1.381, 0.054), (0.649, 6.950, 0.201), (3.008, 63.818, 0.336)),
            1e6: ((0.571, 6.511, 0.046), (0.740, 3.424, 0.051), (2.026, 10.899, 0.153), (5.135, NA, 0.402)),
        },
        "kinetic": {
            1.0: ((0.022, NA, 0.022), (0.191, 0.931, 0.106), (0.499, 2.090, 0.331), (1.782, 5.146, 1.060)),
            100.0: ((0.199, 0.670, 0.122), (0.140, 0.482, 0.086), (0.748, 1.079, 0.237), (17.491, 3.900, 0.535)),
            6e4: ((1.791, 0.467, 0.067), (0.491, 1.343, 0.055), (2.530, 4.481, 0.153), (2.479, 11.807, 0.270)),
            1e6: ((0.302, 1.267, 0.038), (0.827, 2.933, 0.047), (1.133, 12.034, 0.151), (4.280, 143.754, 0.271)),
        },
        "kinetic-q": {
            1.0: ((NA, NA, 0.030), (0.946, 3.114, 0.234), (1.937, 2.879, NA), (2.429, 6.890, NA)),
            100.0: ((0.274, 0.780, 6.882), (0.188, 0.946, 0.761), (0.433, 1.550, 0.307), (1.917, 5.918, 0.538)),
            6e4: ((0.279, 0.707, 0.064), (0.869, 4.225, 0.058), (1.469, 10.784, 0.154), (UNREAD, UNREAD, UNREAD)),
            1e6: ((0.607, 5.312, 0.038), (1.646, 17.037, 0.055), (4.614, 26.056, 0.154), (UNREAD, UNREAD, UNREAD)),
        },
    },
    0.0: {
        "viscous": {
            1.0: ((0.057, NA, 0.056), (0.654, 0.751, 0.356), (4.377, 1.922, 1.606), (14.712, 3.778, 3.273)),
            100.0: ((1.507, NA, 0.349), (0.313, 0.579, 0.134), (0.882, 1.015, 0.326), (18.534, 4.680, 0.604)),
            6e4: ((1.904, 0.583, 0.075), (0.478, 1.112, 0.055), (0.856, 4.496, 0.195), (2.131, NA, 0.357)),
            1e6: ((0.280, 4.077, 0.049), (0.651, 3.222, 0.053), (1.647, 14.354, 0.161), (5.362, NA, 0.441)),
        },
        "kinetic": {
            1.0: ((0.023, NA, 0.022), (0.332, 1.032, 0.139), (0.955, 2.218, 0.409), (2.744, 5.618, 1.118)),
            100.0: ((0.303, 0.691, 0.128), (0.186, 0.420, 0.092), (0.922, 1.037, 0.249), (14.865, 3.622, 0.556)),
            6e4: ((1.526, 0.446, 0.068), (0.447, 1.202, 0.056), (2.107, 4.879, 0.164), (2.139, 14.620, 0.291)),
            1e6: ((0.267, 1.556, 0.041), (0.794, 2.872, 0.053), (1.016, 17.251, 0.161), (4.340, 123.532, 0.279)),
        },
    },
}  # fmt: skip


def best_of_thesis(c, case, n, k):
    """Least time s of the thesis for a cell, over its ways; None where none converged."""
    at = SIZES.index(n), list(CASES).index(case)
    times = [rows[k][at[0]][at[1]] for rows in THESIS[c].values()]
    return min((t for t in times if t is not None and t == t), default=None)


def cell(case, n, k, c, method, repeats=1):
    """The form and the median time s of finding it; the assembly is made before, as the thesis does."""
    s = CASES[case](n, k, c)
    seconds = []
    for _ in range(repeats):
        begin = time.perf_counter()
        form = form_finding(s.assembly, s.loads, s.x, method, groups=s.groups)
        seconds.append(time.perf_counter() - begin)
    return form, statistics.median(seconds)


def cells(quick=False):
    """(damping, case, particles, stiffness, method) -> (form, time s)."""
    sizes = SIZES[:2] if quick else SIZES
    out = {}
    for c in THESIS:
        for case in CASES:
            for k in STIFFNESSES:
                for n in sizes:
                    for method in METHODS:
                        if c == 0.0 and method == "kinetic-q":
                            continue  # as the thesis does
                        fast = method == "equilibrium"
                        out[c, case, n, k, method] = cell(case, n, k, c, method, 5 if fast and not quick else 1)
    return out


def tables(quick):
    """Both tables as markdown, each time beside the thesis' own."""
    found = cells(quick)
    text = []
    for c in THESIS:
        of = [m for m in METHODS if (c, "b2", 13, 1.0, m) in found]
        rows = []
        for case in CASES:
            for k in STIFFNESSES:
                for n in SIZES[:2] if quick else SIZES:
                    shown = []
                    for m in of:
                        form, seconds = found[c, case, n, k, m]
                        theirs = ""
                        if m != "equilibrium":
                            t = THESIS[c][m][k][SIZES.index(n)][list(CASES).index(case)]
                            theirs = f" ({'N/A' if t is None else '-' if t != t else f'{1e3 * t:.0f}'})"
                        ours = f"{1e3 * seconds:.1f}" if form.converged else f"N/A after {form.iterations}"
                        shown.append(ours + theirs)
                    rows.append([case, f"{k:g}", n, *shown])
        text.append(f"Table 8.{1 if c else 3}, c = {c:g} N s/m: ms here (ms of the thesis on its laptop).")
        text.append("\n".join(table(["case", "k N/m", "particles", *of], rows)))
    fast = {key: value for key, value in found.items() if key[-1] == "equilibrium"}
    slowest = max(seconds for _, seconds in fast.values())
    margin = min(
        (t / fast[key][1] for key in fast if (t := best_of_thesis(key[0], key[1], key[2], key[3])) is not None),
        default=0,
    )
    failed = sum(not form.converged for form, _ in fast.values())
    text.append(
        f"Equilibrium engine: {len(fast) - failed} of {len(fast)} cells converge, the slowest in {1e3 * slowest:.1f} "
        f"ms, at least {margin:.0f} times faster than the best time of the thesis in the same cell."
    )
    return lines(text[:1], *text[1:])


ENTRIES = (
    Table(
        "particles.cells",
        "Form finding of particle systems: tables 8.1 and 8.3 of the PSM thesis, complete",
        tables,
    ),
)
