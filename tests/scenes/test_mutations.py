"""Scenes whose files were damaged at random are read or refused, nothing else."""

import shutil

import numpy as np
import pytest

import scenes
from tests.scenes.broken import BUILT_IN, built, copy_of

TOKENS = [
    b"nan",
    b"-1",
    b"0",
    b"1e308",
    b"1e-320",
    b"9" * 400,
    b'"',
    b"'",
    b",",
    b"\n",
    b"\r",
    b"\x00",
    b"\xff",
    b"[",
    b"]",
    b"{",
    b"}",
    b"=",
    b"true",
    b"#",
    b" ",
    b"\xc2\xa0",
    b"\xe2\x82\xac",
    b"1979-05-27",
    b"[settings.x]\n",
    b"default = 1\n",
    b"inf",
    b".",
    b"",
]


def _damaged(rng, content):
    """Content with one to three random changes: bytes or words replaced, inserted, removed; rows doubled, swapped."""
    for _ in range(rng.integers(1, 4)):
        kind = rng.integers(6)
        at = int(rng.integers(len(content) + 1))
        if kind == 0:
            content = content[:at] + bytes([rng.integers(256)]) + content[at + 1 :]
        elif kind == 1:
            content = content[:at] + TOKENS[rng.integers(len(TOKENS))] + content[at:]
        elif kind == 2:
            content = content[:at] + content[at + int(rng.integers(1, 30)) :]
        elif kind == 3:  # a cell, a value or a word gives way to something else
            words = content.replace(b",", b" ,").split(b" ")
            words[rng.integers(len(words))] = TOKENS[rng.integers(len(TOKENS))]
            content = b" ".join(words).replace(b" ,", b",")
        else:
            rows = content.split(b"\n")
            i, j = rng.integers(len(rows), size=2)
            if kind == 4:
                rows[i] = rows[j]
            else:
                rows[i], rows[j] = rows[j], rows[i]
            content = b"\n".join(rows)
    return content


def _targets():
    for scene in scenes.available():
        for path in sorted((BUILT_IN / scene).iterdir()):
            if path.suffix in (".csv", ".toml"):
                few = path.name == "polars.csv" or scene == "parafoil_160"  # which take half a second each
                yield scene, path.name, 5 if few else (60 if path.suffix == ".toml" else 25)


@pytest.mark.parametrize(("scene", "file", "count"), list(_targets()), ids=lambda v: str(v))
def test_damaged_file_is_read_or_refused_in_one_sentence(scene, file, count, tmp_path):
    folder = copy_of(scene, tmp_path)
    intact = (folder / file).read_bytes()
    rng = np.random.default_rng([len(scene), *file.encode()])
    refused, coarse = 0, {"variant": "sketch"} if scene in ("box_wing", "swept_wing") else None
    for n in range(count):
        content = _damaged(rng, intact)
        (folder / file).write_bytes(content)
        try:
            _, structure, flow = built(folder, {"variant": "restoring"} if "restoring" in file else coarse)
        except scenes.SceneError as error:
            refused += 1
            if "\n" in str(error):
                pytest.fail(f"more than one line: {error}")
        except Exception as error:
            kept = tmp_path / f"{n}-{file}"
            shutil.copy(folder / file, kept)
            pytest.fail(f"{type(error).__name__}: {error} (see {kept})")
        else:
            assert np.all(np.isfinite((structure or flow).get("displacement")))
    if count > 20:
        assert refused > 0  # damage is noticed
