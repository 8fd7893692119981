"""Random moving structures as scenes: springs that swing, weights that are let down, lines in the wind, lines that jerk
taut; (kind, rng, folder) -> the scene in `folder` and how long its steps are.
"""

import numpy as np

GRAVITY, MODULUS = 9.81, 1e9
STEPS = 60
SCHEMES = ("generalised-alpha", "generalised-alpha", "bdf2", "implicit-euler")
# Steps in a period of the fastest element, at most; of lines that jerk taut there is less than one, so that the scheme
# does not resolve them.
RESOLVED, UNRESOLVED = 60.0, (0.3, 5.0)


def _write(path, head, rows):
    path.write_text("\n".join([head, *(",".join(str(v) for v in row) for row in rows)]) + "\n")


def _diameter(ea):
    return float(np.sqrt(4.0 * ea / (np.pi * MODULUS)))


def _tied(rng, n, held):
    """Pairs that tie every node to a support, and some more."""
    order = [*np.flatnonzero(held), *rng.permutation(np.flatnonzero(~held))]
    pairs = {tuple(sorted((int(rng.choice(order[:i])), int(order[i])))) for i in range(int(held.sum()), n)}
    pairs |= {tuple(sorted(map(int, rng.choice(n, 2, replace=False)))) for _ in range(n)}
    return sorted(pairs)


def _net(rng):
    n = int(rng.integers(4, 12))
    size = float(10.0 ** rng.uniform(0.0, 1.5))
    x, held = size * rng.uniform(-1.0, 1.0, (n, 3)), np.arange(n) < 3
    pairs = [pair for pair in _tied(rng, n, held) if not held[list(pair)].all()]
    length = np.array([np.linalg.norm(x[b] - x[a]) for a, b in pairs])
    return x, held, pairs, length, rng.uniform(0.5, 5.0, n) * ~held


def _fastest(pairs, k, mass):
    """Bound of the highest frequency, 1/s: twice the stiffness at a node over its mass."""
    at = np.zeros(len(mass))
    for (a, b), stiffness in zip(pairs, k, strict=True):
        at[a] += stiffness
        at[b] += stiffness
    free = mass > 0.0
    return float(np.sqrt(2.0 * (at[free] / mass[free]).max()))


def _scene(folder, rng, step, more, radius=None):
    scheme = str(rng.choice(SCHEMES)) if radius is None else "generalised-alpha"
    radius = float(rng.choice([0.0, 0.5, 0.9])) if radius is None else radius
    structure = more.pop("structure", [])
    lines = [
        'title = "random motion"', "[structure]", f"gravity = {GRAVITY}", f"line_modulus = {MODULUS}",
        *(f'{f.stem} = "{f.name}"' for f in sorted(folder.glob("*.csv"))), *structure, *more.pop("sections", []),
        "[dynamics]", f'scheme = "{scheme}"', f"spectral_radius = {radius}", f"stop_time = {STEPS * step!r}",
    ]  # fmt: skip
    (folder / "scene.toml").write_text("\n".join(lines) + "\n")
    return {"step": step, "order": 1 if scheme == "implicit-euler" else 2, **more}


def _tables(folder, x, held, mass):
    places = [(f"n{i}", *map(float, p), "xyz" if held[i] else "") for i, p in enumerate(x)]
    _write(folder / "nodes.csv", "node,x_m,y_m,z_m,fixed", places)
    _write(folder / "masses.csv", "node,mass_kg", [(f"n{i}", float(m)) for i, m in enumerate(mass) if m > 0.0])


def _lines(folder, pairs, l0, ea):
    _write(folder / "lines.csv", "name,nodes,rest_length_m,diameter_m",
           [(f"l{i}", f"n{a} n{b}", float(l0[i]), _diameter(ea[i])) for i, (a, b) in enumerate(pairs)])  # fmt: skip


def springs(rng, folder):
    """Springs between weights, let go from anywhere: smooth, whatever they do."""
    x, held, pairs, length, mass = _net(rng)
    k = 10.0 ** rng.uniform(1.5, 3.0) * rng.uniform(0.5, 2.0, len(pairs))
    l0 = rng.uniform(0.8, 1.1, len(pairs)) * length
    _write(folder / "springs.csv", "name,nodes,rest_length_m,stiffness_N_per_m,mass_kg",
           [(f"s{i}", f"n{a} n{b}", float(l0[i]), float(k[i]), 0.0) for i, (a, b) in enumerate(pairs)])  # fmt: skip
    _tables(folder, x, held, mass)
    step = 2.0 * np.pi / _fastest(pairs, k, mass) / RESOLVED
    return _scene(folder, rng, float(step), {"smooth": True})


def _hung(rng):
    """A row of weights on lines below a support, at rest: places, masses, pairs, rest lengths and EA."""
    n = int(rng.integers(2, 6))
    mass = np.concatenate([[0.0], rng.uniform(0.5, 5.0, n - 1)])
    length, pull = rng.uniform(1.0, 10.0, n - 1), GRAVITY * np.cumsum(mass[::-1])[::-1][1:]
    ea = 10.0 ** rng.uniform(3.5, 4.5) * rng.uniform(0.5, 2.0, n - 1)
    x = np.zeros((n, 3))
    x[1:, 2] = -np.cumsum(length)
    return x, np.arange(n) == 0, mass, [(i, i + 1) for i in range(n - 1)], length / (1.0 + pull / ea), ea


def reels(rng, folder):
    """Weights in a row at rest, let down or drawn up by a rate of reeling that is ramped."""
    x, held, mass, pairs, l0, ea = _hung(rng)
    _lines(folder, pairs, l0, ea)
    _tables(folder, x, held, mass)
    step = float(2.0 * np.pi / _fastest(pairs, ea / l0, mass) / RESOLVED)
    end = STEPS * step
    # up to a quarter of the line, and gentle enough that weight keeps all lines taut
    rate = float(rng.choice([-1.0, 1.0]) * min(0.25 * l0[0] / end, 0.1 * GRAVITY * end))
    inputs = folder / "inputs.txt"
    _write(inputs, "time,top_rate", [(0.0, 0.0), (end, rate)])
    tapes = ["[structure.tapes]", 'top = ["l0"]']
    return _scene(folder, rng, step, {"structure": tapes, "inputs": inputs, "smooth": True})


def wind(rng, folder):
    """Weights in a row at rest, in a wind that sets in."""
    x, held, mass, pairs, l0, ea = _hung(rng)
    _lines(folder, pairs, l0, ea)
    _tables(folder, x, held, mass)
    step = float(2.0 * np.pi / _fastest(pairs, ea / l0, mass) / RESOLVED)
    air = ["[settings.line_drag]", "default = 'on'", "options = ['on']", "[aero]",
           f"wind_speed = {float(rng.uniform(1.0, 20.0))!r}"]  # fmt: skip
    return _scene(folder, rng, step, {"sections": air, "smooth": True})


def slack(rng, folder):
    """Weights in a net of loose stiff lines, which jerk taut within steps that do not resolve them."""
    x, held, pairs, length, mass = _net(rng)
    l0 = rng.uniform(0.9, 1.3, len(pairs)) * length
    ea = 10.0 ** rng.uniform(4.0, 7.0) * rng.uniform(0.5, 2.0, len(pairs))
    _lines(folder, pairs, l0, ea)
    _tables(folder, x, held, mass)
    step = 2.0 * np.pi / _fastest(pairs, ea / l0, mass) / rng.uniform(*UNRESOLVED)
    return _scene(folder, rng, float(min(step, 0.1)), {"smooth": False}, float(rng.choice([0.0, 0.5, 1.0])))


KINDS = {"springs": springs, "reels": reels, "wind": wind, "slack": slack}


def random_motion(kind, rng, folder):
    """The scene of a kind (see `KINDS`): its `step` s, the `order` of its scheme, the file of its `inputs` if it has
    any, and whether its motion is `smooth`.
    """
    folder.mkdir()
    return {"inputs": None} | KINDS[kind](rng, folder)
