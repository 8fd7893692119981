"""What random calls on FMUs pass, from legal to absurd, and what a message is."""

import re

import numpy as np

LEAKS = re.compile(r"Traceback|\b[A-Z]\w*(Error|Warning|Exception|Interrupt)\b|<\w+ object|\n|array\(")
ODD = (np.nan, np.inf, -np.inf, -0.0, 0.0, 5e-324, 1e300, -1e300, 1.7976931348623157e308)


def references(rng, library):
    """Told, value references, and whether they are known."""
    size = library.size
    names = list(library.blocks)
    match int(rng.integers(11)):
        case 10:
            of = library.places("parameter", kind="Real")
            return "parameters", rng.permutation(of)[: int(rng.integers(1, len(of) + 1))].tolist()
        case 0 | 1 | 2 | 3:
            settable = [n for n, (_, c, _) in library.blocks.items() if c != "output"]
            name = str(rng.choice(settable))
            return name, library.blocks[name][2]
        case 4:
            name = str(rng.choice(names))
            return name, library.blocks[name][2]
        case 5 | 6:
            few = library.places("input", "parameter")
            return "one", [int(rng.choice(few))]
        case 7:
            return "scattered", rng.integers(0, size, int(rng.integers(1, 20))).tolist()
        case 8:
            few = library.places("input", "parameter", kind="Real")
            return "repeated", rng.choice(few, int(rng.integers(1, 30))).tolist()
        case _:
            odd = ([], [size], [2**32 - 1], [2**31], [0, size + 5], list(range(size)), [0] * 10000)
            return "odd", list(odd[int(rng.integers(len(odd)))])


def reals(rng, old):
    """Told, and values near or far from old ones."""
    n = len(old)
    base = np.where(np.isfinite(old) & (old != 0.0), old, 0.01 * rng.standard_normal(n))
    match int(rng.integers(8)):
        case 0 | 1:
            return "near", base * (1.0 + 0.02 * rng.standard_normal(n))
        case 2:
            return "times", base * 10.0 ** rng.uniform(-3, 9)
        case 3:
            return "one far", np.where(np.arange(n) == rng.integers(max(n, 1)), base * 10.0 ** rng.uniform(3, 9), base)
        case 4:
            return "one odd", np.where(np.arange(n) == rng.integers(max(n, 1)), rng.choice(ODD), base)
        case 5:
            return "all odd", np.full(n, rng.choice(ODD))
        case 6:
            return "any", rng.standard_normal(n) * 10.0 ** rng.uniform(-9, 9)
        case _:
            return "same", old


def sentence(text):
    """What is wrong with a message, or nothing. It goes to a printf: per cent signs come doubled."""
    try:
        plain = text.decode()
    except UnicodeDecodeError:
        return "is not UTF-8"
    if "%" in plain.replace("%%", ""):
        return "has a lone per cent sign"
    if LEAKS.search(plain):
        return "shows what only Python knows"
    if not re.match(r"[A-Za-z]", plain) or not plain.endswith(".") or not 10 <= len(plain) <= 600:
        return "is no sentence"
    return ""
