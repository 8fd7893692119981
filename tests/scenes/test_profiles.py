"""Wing profiles against the definitions of their families; files of coordinates; points round a profile."""

import numpy as np
import pytest
from scipy.integrate import quad

from scenes.builders.profiles import REFLEX, Profile, cst, from_coordinates, geometric, naca
from scenes.readers.coordinates import read_profile
from scenes.schema import SceneError

FINE = np.linspace(0.0, 1.0, 20001)  # the largest of a smooth function is found to 1e-9
EXACT = 1e-12  # the same formula, rounded


@pytest.mark.parametrize("digits", ["0006", "0012", "2412", "4415", "23018", "23112"])
def test_the_thickness_of_a_naca_profile_is_what_its_last_digits_say(digits):
    thickness = naca(digits).thickness(FINE)
    # the polynomial peaks at 1.00012 times the number, at 30 % of the chord
    assert thickness.max() == pytest.approx(0.01 * int(digits[-2:]), rel=2e-4)
    assert FINE[thickness.argmax()] == pytest.approx(0.30, abs=0.002)


def test_the_nose_radius_of_a_naca_profile_is_that_of_the_definition():
    t = np.array([1e-8])
    half = naca("0012").upper(t)[0, 1]
    assert half**2 / (2.0 * t[0]) == pytest.approx(1.1019 * 0.12**2, rel=1e-3)  # z^2 = 2 r x, next term sqrt(x)


@pytest.mark.parametrize(("digits", "camber", "place"), [("2412", 0.02, 0.4), ("4415", 0.04, 0.4), ("6712", 0.06, 0.7)])
def test_the_camber_of_four_digits_is_what_the_first_two_say(digits, camber, place):
    z = naca(digits).camber(FINE)[:, 1]
    assert z.max() == pytest.approx(camber, abs=EXACT)
    assert FINE[z.argmax()] == pytest.approx(place, abs=1e-4)


def thin_aerofoil(profile):
    """Ideal lift coefficient and moment about the quarter chord, by Glauert's integrals of the slope of the camber."""

    def slope(angle):
        x = 0.5 * (1.0 - np.cos(angle))
        h = 1e-6
        z = profile.camber(np.array([max(x - h, 0.0), min(x + h, 1.0)]))
        return (z[1, 1] - z[0, 1]) / (z[1, 0] - z[0, 0])

    # A0 is the integral of the slope itself, which is zero over the chord at the ideal angle of attack
    a1, a2 = (
        2.0 / np.pi * quad(lambda v, k=k: slope(v) * np.cos(k * v), 0.0, np.pi, limit=400, epsabs=1e-8)[0]
        for k in (1, 2)
    )
    return np.pi * a1, 0.25 * np.pi * (a2 - a1)


@pytest.mark.parametrize("digits", ["21012", "23012", "25012", "43012"])
def test_five_digits_have_their_design_lift_and_place_of_camber(digits):
    profile = naca(digits)
    lift, _ = thin_aerofoil(profile)
    assert lift == pytest.approx(0.15 * int(digits[0]), rel=1e-3)  # slope by differences over 2e-6 of the chord
    z = profile.camber(FINE)[:, 1]
    assert FINE[z.argmax()] == pytest.approx(0.05 * int(digits[1]), abs=1e-4)


@pytest.mark.parametrize("place", REFLEX)
def test_reflexed_five_digits_have_their_design_lift_and_no_moment(place):
    lift, moment = thin_aerofoil(naca(f"2{place}12"))
    assert lift == pytest.approx(0.3, rel=0.02)  # of the table, with three digits: 1.7 % off at its end (25112)
    assert moment == pytest.approx(0.0, abs=2e-3)


def test_an_original_naca_profile_is_blunt_and_closed_by_a_wedge_which_is_said():
    blunt = naca("0012", closed=False)
    assert blunt.gap == pytest.approx(2 * 5 * 0.12 * 0.0021, abs=EXACT)  # sum of the coefficients
    with pytest.raises(ValueError, match="blunt trailing edge"):
        blunt.points(20)
    shut = blunt.closed()
    assert shut.gap == 0.0
    assert "0.252 % of the chord" in shut.remarks[0]
    assert np.allclose(blunt.thickness(FINE) - shut.thickness(FINE), blunt.gap * FINE, rtol=0.0, atol=EXACT)
    assert naca("0012").gap == 0.0
    assert naca("0012").closed().remarks == ()


def test_cst_with_equal_weights_is_the_class_function():
    profile = cst([0.3] * 6, [0.3] * 6)
    z = profile.upper(FINE)[:, 1]
    assert np.allclose(z, 0.3 * np.sqrt(FINE) * (1.0 - FINE), rtol=0.0, atol=EXACT)  # Bernstein polynomials sum to one
    # the ram-air thesis' first profile: 0.6 times the largest of sqrt(t) (1 - t), which is 2 / (3 sqrt 3)
    assert profile.thickness(FINE).max() == pytest.approx(0.6 * 2.0 / (3.0 * np.sqrt(3.0)), abs=1e-8)


def test_the_weights_of_cst_at_the_ends_are_nose_radius_and_boat_tail():
    profile = cst([0.2, 0.5, 0.1], [0.15, 0.1], gap=0.01)
    t = np.array([1e-10, 1.0 - 1e-7, 1.0])
    z = profile.upper(t)[:, 1]
    assert z[0] ** 2 / (2.0 * t[0]) == pytest.approx(0.5 * 0.2**2, rel=1e-4)  # r = w0^2 / 2
    assert (z[1] - z[2]) / 1e-7 == pytest.approx(0.1 - 0.005, rel=1e-5)  # tan beta = w_n less that of the gap
    assert profile.gap == pytest.approx(0.01, abs=EXACT)
    assert profile.closed().gap == 0.0
    assert profile.lower(np.array([0.3]))[0, 1] < 0.0


@pytest.mark.parametrize("panels", [4, 24, 55, 78])
@pytest.mark.parametrize("spacing", ["cosine", "geometric", "uniform"])
def test_a_profile_has_exactly_as_many_points_as_panels_and_they_lie_on_it(panels, spacing):
    profile = naca("2412")
    points = profile.points(panels, spacing)
    assert points.shape == (panels, 2)
    assert len(np.unique(points, axis=0)) == panels
    assert np.array_equal(points[0], [1.0, 0.0])
    upper = points[: panels - panels // 2 + 1]
    assert np.array_equal(upper[-1], [0.0, 0.0])
    x, z = points.T
    assert 0.5 * np.sum(x * np.roll(z, -1) - np.roll(x, -1) * z) > 0.0  # counter-clockwise: over the upper side first


def test_panels_in_geometric_progression_grow_by_the_same_share_from_the_nose():
    lengths = np.linalg.norm(np.diff(naca("0018").points(160, "geometric", 0.05)[80:], axis=0), axis=1)
    growth = lengths[1:] / lengths[:-1]
    # chords under arcs: shorter by (length / radius)^2 / 24, 3e-6 at a nose radius of 3.6 % and panels of 3e-4
    assert np.allclose(growth, 1.05, rtol=1e-3)
    assert np.allclose(np.diff(geometric(10, 0.0)), 0.1, rtol=EXACT)


def test_a_symmetric_profile_has_symmetric_points_to_the_last_bit():
    for spacing in ("cosine", "geometric"):
        points = naca("0012").points(34, spacing)
        assert np.array_equal(points[1:], points[:0:-1] * [1.0, -1.0])


COORDINATES = naca("2412").points(120)


def selig(points, name="NACA 2412"):
    return "\n".join([name, *(f" {x:.8f} {z:.8f}" for x, z in [*points, points[0]])])


def lednicer(points, counts=True, name="NACA 2412"):
    upper, lower = points[60::-1], [*points[60:], points[0]]
    rows = [[f" {x:.8f}  {z:.8f}" for x, z in side] for side in (upper, lower)]
    head = [f"  {len(upper)}.   {len(lower)}."] if counts else []
    return "\n".join([name, *head, "", *rows[0], "", *rows[1]])


FILES = {
    "Selig": selig(COORDINATES),
    "Selig, lower side first": selig(np.roll(COORDINATES[::-1], 1, axis=0)),
    "Lednicer": lednicer(COORDINATES),
    "Lednicer without counts": lednicer(COORDINATES, counts=False),
    "commas": selig(COORDINATES).replace(" 0", ", 0").replace("\n,", "\n"),
    "per cent of the chord": selig(100.0 * COORDINATES),
}


@pytest.mark.parametrize("order", FILES)
def test_a_file_of_coordinates_gives_back_its_profile_in_every_order(tmp_path, order):
    path = tmp_path / "foil.dat"
    path.write_text(FILES[order])
    profile = read_profile(path)
    assert profile.name == "NACA 2412"
    x = np.linspace(0.001, 1.0, 500)
    nose = naca("2412").upper(np.linspace(0.0, 1e-3, 2001))[:, 0].min()  # -8e-5: the camber line rises there
    for name in ("upper", "lower"):
        found = getattr(profile, name)(x)
        exact = (getattr(naca("2412"), name)(FINE) - [nose, 0.0]) / (1.0 - nose)
        # a cubic spline through 120 points, the 8 digits of the file, and straight lines between 20000 exact points
        assert np.abs(found[:, 1] - np.interp(found[:, 0], *exact.T)).max() < 2e-5
        assert np.allclose(found[:, 0], x, rtol=0.0, atol=1e-6)
    assert bool(profile.remarks) == (order == "per cent of the chord")


def test_a_blunt_file_is_closed(tmp_path):
    path = tmp_path / "foil.dat"
    upper, lower = (np.column_stack([COORDINATES[k, 0], COORDINATES[k, 1]]) for k in (slice(0, 61), slice(61, None)))
    lower = np.concatenate([lower, COORDINATES[:1]])
    upper[:, 1] += 0.002 * upper[:, 0]
    lower[:, 1] -= 0.002 * lower[:, 0]
    path.write_text("\n".join(f"{x} {z}" for x, z in [*upper, *lower]))
    profile = read_profile(path)
    assert profile.name == "foil"
    assert profile.gap == pytest.approx(0.004, rel=1e-4)  # of the chord from the foremost point, 1.00008
    assert "0.4 % of the chord" in profile.closed().remarks[0]
    # the wedge taken off is the one put on, but for the place of x = 0 within the spline's nose
    assert (
        np.abs(
            profile.closed().thickness(FINE) - from_coordinates([*COORDINATES, COORDINATES[0]]).thickness(FINE)
        ).max()
        < 1e-4
    )


BAD_FILES = {
    "no file": (None, "does not exist"),
    "words": ("foil\n1 0\n0.5 abc\n0 0\n", "row 3: '0.5 abc' is no pair of numbers"),
    "three numbers": ("foil\n1 0 0\n", "row 2: '1 0 0' is no pair of numbers"),
    "counts": ("foil\n 3. 3.\n0 0\n.5 .1\n1 0\n0 0\n1 0\n", "says that 3 and 3 points follow, but 5 do"),
    "few": ("foil\n1 0\n.5 .1\n0 0\n.5 -.1\n1 0\n", "5 different points; 6 are needed"),
    "empty": ("", "0 different points"),
    "line": ("foil\n" + "\n".join(f"{x} 0" for x in (1, 0.8, 0.5, 0, 0.1, 0.2, 1)), "encloses no area"),
    "from the nose": (selig(np.roll(COORDINATES, -60, axis=0)), "does not begin and end at its trailing edge"),
    "infinite": ("foil\n1 0\n.5 inf\n.2 .1\n0 0\n.2 -.1\n.5 -.1\n1 0\n", "finite numbers"),
    "not text": (b"\xff\xfe\x00\x81", "is not a readable text"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_a_bad_file_of_coordinates_is_refused_in_one_sentence(tmp_path, case):
    content, words = BAD_FILES[case]
    path = tmp_path / "foil.dat"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(SceneError, match=r"^[^\n]*foil.dat[^\n]*[.]$") as caught:
        read_profile(path)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("digits", "words"),
    [
        ("12", "no NACA profile of four or five"),
        ("abcd", "no NACA profile of four or five"),
        ("0000", "no thickness"),
        ("2012", "camber without its place"),
        ("0412", "a place of camber without camber"),
        ("23212", "no camber line"),
        ("21112", "no camber line"),
        ("03012", "no camber line"),
        ("26012", "no camber line"),
    ],
)
def test_naca_digits_without_a_meaning_are_refused(digits, words):
    with pytest.raises(ValueError, match=words):
        naca(digits)


def test_a_profile_needs_four_panels_and_a_known_spacing():
    with pytest.raises(ValueError, match="4 panels at least"):
        naca("0012").points(3)
    with pytest.raises(ValueError, match="choose one of: cosine, geometric, uniform"):
        naca("0012").points(20, "sine")
    with pytest.raises(ValueError, match="a weight at least"):
        cst([], [0.1])
    assert isinstance(naca("naca 0012"), Profile)
