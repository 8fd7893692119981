"""Chains, stars and rings of five participants with all types of signals against a loop written by hand, bitwise."""

import numpy as np
import pytest

from master import couple
from master.fmu_coupling.document import Document
from tests.master.guests import coupling, guest
from tests.master.test_couple_signals import MODE

STEP, COUNT = 0.1, 20
ITEMS = (1, 2, 5)
SIGNALS = ("x", "n", "b", "m", "v")  # Real, Integer, Boolean, Enumeration, array
NODE = [
    ("x_in", 0, "input", "Real", ""),
    ("x_out", 1, "output", "Real", ""),
    ("n_in", 0, "input", "Integer", ""),
    ("n_out", 1, "output", "Integer", ""),
    ("b_in", 0, "input", "Boolean", ""),
    ("b_out", 1, "output", "Boolean", ""),
    ("m_in", 2, "input", "Enumeration", 'declaredType="Mode" start="1"'),
    ("m_out", 3, "output", "Enumeration", 'declaredType="Mode"'),
    *[(f"v_in[{i}]", 9 + i, "input", "Real", "") for i in (1, 2, 3)],
    *[(f"v_out[{i}]", 19 + i, "output", "Real", "") for i in (1, 2, 3)],
    ("id", 5, "parameter", "Integer", ""),
]
CODE = {
    "begin": "k[2] = k[3] = 1",
    "step": (
        "double s = 0.1 * k[5]; r[1] = 0.9 * r[1] + h * (s - 0.5 * r[0] * r[0] + 0.1 * k[0] + (b[0] ? 0.3 : -0.2));"
        "for (int i = 0; i < 3; i++) r[20 + i] = 0.8 * r[20 + i] + h * (r[10 + (i + 1) % 3] + r[1] * k[2]);"
        "k[1] = (k[0] + k[5]) % 7; b[1] = r[1] > 0.2 ? !b[0] : b[0]; k[3] = k[2] == 1 ? 2 : k[2] == 2 ? 5 : 1"
    ),
}


class Node:
    """The equations of CODE, operation by operation."""

    def __init__(self, number):
        self.number = number
        self.inputs = {"x": 0.0, "n": 0, "b": 0, "m": 1, "v": np.zeros(3)}
        self.outputs = {"x": 0.0, "n": 0, "b": 0, "m": 1, "v": np.zeros(3)}

    def step(self, h):
        u, y = self.inputs, self.outputs
        s = 0.1 * self.number
        x = 0.9 * y["x"] + h * (s - 0.5 * u["x"] * u["x"] + 0.1 * u["n"] + (0.3 if u["b"] else -0.2))
        v = np.array([0.8 * y["v"][i] + h * (u["v"][(i + 1) % 3] + x * u["m"]) for i in range(3)])
        n, b = (u["n"] + self.number) % 7, int(not u["b"]) if x > 0.2 else u["b"]
        self.outputs = {"x": x, "n": n, "b": b, "m": {1: 2, 2: 5, 5: 1}[u["m"]], "v": v}


NAMES = ("a", "b", "c", "d", "e")
LINKS = {
    "chain": [("a", "b"), ("b", "c"), ("c", "d"), ("d", "e")],
    "chain backwards": [("e", "d"), ("d", "c"), ("c", "b"), ("b", "a")],
    "star": [("c", "a"), ("c", "b"), ("c", "d"), ("c", "e")],
    "ring": [("a", "b"), ("b", "c"), ("c", "d"), ("d", "e"), ("e", "a")],
}


def by_hand(links, order):
    """What every participant sends after each step of the explicit scheme, in the order of the names."""
    nodes = {name: Node(k + 1) for k, name in enumerate(NAMES)}
    found = []
    for _ in range(COUNT):
        before = {name: node.outputs for name, node in nodes.items()}
        for name, node in nodes.items():
            for source, target in links:
                if target == name:
                    node.inputs = dict(before[source] if order == "parallel" else nodes[source].outputs)
            node.step(STEP)
        found.append({name: node.outputs for name, node in nodes.items()})
    return found


@pytest.fixture(scope="module")
def nodes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("five")
    # fused multiply-adds would round other than the loop
    guest(folder, "node", NODE, types=MODE, **CODE)
    return folder


def five(shape, elements, **settings):
    """The content of a coupling of five nodes; arrays whole, or their elements one by one."""
    links = []
    for source, target in LINKS[shape]:
        for signal in SIGNALS:
            ends = [f"[{i}]" for i in (1, 2, 3)] if signal == "v" and elements else [""]
            links += [(f"{source}.{signal}_out{end}", f"{target}.{signal}_in{end}") for end in ends]
    fmus = {name: {"fmu": "node.fmu", "start": {"id": k + 1}} for k, name in enumerate(NAMES)}
    record = [f"{name}.{signal}_out" for name in NAMES for signal in SIGNALS]
    return coupling(fmus, links, STEP * COUNT, STEP, record, **settings)


@pytest.mark.parametrize("elements", [False, True], ids=["arrays", "elements"])
@pytest.mark.parametrize("order", ["serial", "parallel"])
@pytest.mark.parametrize("shape", LINKS)
def test_five_participants_exchange_all_types_as_a_loop_by_hand_does_bitwise(nodes, shape, order, elements):
    seen = []
    content = five(shape, elements, scheme="explicit", order=order)
    result = couple(
        Document.of(content, nodes),
        follow=lambda n, t, r, values: seen.append({k: v.copy() for k, v in values.items()}),
    )
    assert result.status == "converged", result.message
    for values, nodes_then in zip(seen[1:], by_hand(LINKS[shape], order), strict=True):
        for name, outputs in nodes_then.items():
            for signal, expected in outputs.items():
                assert np.array_equal(values[f"{name}.{signal}_out"], expected), (name, signal)


@pytest.mark.parametrize("scheme", ["relaxation", "aitken", "iqn-ils", "iqn-imvj"])
def test_a_chain_is_the_same_with_every_scheme(nodes, scheme):
    last = by_hand(LINKS["chain"], "serial")[-1]
    values = couple(Document.of(five("chain", False, scheme=scheme), nodes)).values
    for name, outputs in last.items():
        for signal, expected in outputs.items():
            assert np.array_equal(values[f"{name}.{signal}_out"], expected), (name, signal)
