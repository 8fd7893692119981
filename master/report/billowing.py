"""The plot of the sections of an inflatable wing: how its canopy billows between the struts (LEI thesis 7.3)."""

from typing import TYPE_CHECKING

import numpy as np

from master.report.figures import DARK, LIGHT, MIDDLE, WIDTH, axes_at, new_figure, style
from master.report.sections import Sections

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEIGHT, LEFT, BOTTOM, TALL, WIDE = 4.1, 0.8, 1.3, 2.3, 2.65  # in, of the figure and of its panels
EXAGGERATIONS = (50, 20, 10, 5, 2, 1)
LEAST = 0.01  # chords, range of the profiles that fills their panel at least
FLAT = 1e-6  # chords; a design shape below it is not drawn
ALIKE = 1e-4  # chords; below it left and right wing lie on each other in the plot


def billowing_figure(found: Sections, title: str) -> "Figure":
    """Profiles in the middle of the bays and at the struts, and camber % over the span."""
    with style():
        figure = new_figure(HEIGHT, title)
        _profiles(figure, axes_at(figure, LEFT, BOTTOM, WIDE, TALL), found)
        _cambers(axes_at(figure, LEFT + WIDE + 0.9, BOTTOM, WIDTH - LEFT - WIDE - 1.05, TALL), found)
    return figure


def _profiles(figure: "Figure", panel: "Axes", found: Sections) -> None:
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize
    from matplotlib.lines import Line2D

    distance, right = np.abs(found.arc), found.arc >= 0.0
    alike = np.abs(found.z - found.z[::-1]).max() <= ALIKE
    cut = ListedColormap(colormaps["viridis"](np.linspace(0.0, 0.92, 256)))  # the palest would vanish on paper
    colours = ScalarMappable(Normalize(0.0, float(distance.max()) or 1.0), cut)
    if np.abs(found.design_z).max() > FLAT:
        for c in found.middle:
            panel.plot(found.design_x[c], found.design_z[c], ":", color="0.3", lw=0.8, zorder=2, gid="design")
    for c in np.flatnonzero(found.strut):
        panel.plot(found.x[c], found.z[c], color="0.6", lw=0.6, zorder=2, gid="strut")
    for c in found.middle:
        look = "-" if right[c] else "--"
        panel.plot(found.x[c], found.z[c], look, color=colours.to_rgba(distance[c]), zorder=3, gid="bay")
    low, high = float(min(found.z.min(), found.design_z.min())), float(max(found.z.max(), found.design_z.max()))
    room = 1.12 * max(high - low, LEAST)
    per_chord = WIDE / 1.06  # in
    times = next((k for k in EXAGGERATIONS if k * per_chord * room <= TALL), 1)
    half = 0.5 * max(TALL / (times * per_chord), room)
    panel.set_xlim(-0.03, 1.03)
    panel.set_ylim(0.5 * (low + high) - half, 0.5 * (low + high) + half)
    panel.set_title(f"sections; z/c drawn {times} times as large as x/c", loc="left", pad=3.0)
    panel.set_xlabel("distance along the chord x/c, \u2013", labelpad=1.0)
    panel.set_ylabel("distance from the chord z/c, \u2013")
    panel.grid(True)
    bar = figure.colorbar(colours, cax=axes_at(figure, LEFT, 0.68, WIDE, 0.1), orientation="horizontal")
    bar.set_label("distance from mid-span along the arc, m", labelpad=1.0)
    text = "middle of a bay, " + ("left and right wing alike" if alike else "right wing")
    shown = [Line2D([], [], color=MIDDLE, label=text)]
    shown += [] if alike else [Line2D([], [], color=MIDDLE, ls="--", label="left wing")]
    shown += [Line2D([], [], color="0.6", lw=0.6, label="at a strut")]
    if np.abs(found.design_z).max() > FLAT:
        shown.append(Line2D([], [], color="0.3", lw=0.8, ls=":", label="design shape"))
    figure.legend(handles=shown, loc="lower left", bbox_to_anchor=(0.4 / WIDTH, 0.03 / HEIGHT), ncols=4)


def _cambers(panel: "Axes", found: Sections) -> None:
    percent = 100.0 * found.camber
    panel.axhline(0.0, color="0.3", lw=0.5)
    design = 100.0 * found.design_camber
    if np.abs(found.design_z).max() > FLAT:
        panel.plot(found.arc, design, ":", color="0.3", lw=0.8, label="design")
    panel.plot(found.arc, percent, "o-", color=DARK, ms=3.0, label="canopy")
    panel.plot(found.arc[found.strut], percent[found.strut], "s", color=LIGHT, ms=4.5, label="strut", zorder=3)
    both = np.concatenate([percent, design])
    half = max(0.55 * float(np.ptp(both)), 0.5)
    middle = 0.5 * float(both.min() + both.max())
    panel.set_ylim(min(middle - half, -0.05 * half), max(middle + half, 0.05 * half))
    most = found.most
    text = f"largest {percent[most]:.2f} % at x/c {found.place[most]:.2f}, arc {abs(found.arc[most]):.2f} m"
    panel.set_title(text, loc="left", pad=3.0)
    panel.set_xlabel("arc length from mid-span, m (right wing positive)", labelpad=1.0)
    panel.set_ylabel("camber, % (of the chord)")
    panel.grid(True)
    panel.legend(loc="upper left", bbox_to_anchor=(0.0, -0.2), ncols=3, borderaxespad=0.0)
