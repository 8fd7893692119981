"""Settings and variants of a scene: the choices that scene.toml offers, checked."""

from collections.abc import Iterable
from typing import Any

from ..schema import INTEGRATION, SceneError, Setting

# The settings that a scene may offer, with the options that have a meaning; None: what the scene makes of it.
OPTIONS = {
    "chord": ("structural", "design"), "line_drag": ("on", "off"), "panels_per_section": None, "variant": None,
    "canopy_stations": None, "canopy_subdivisions": None, "tube_law": ("breukels", "fabric", "tip-deflection"),
    "camber_feedback": ("on", "off"), "scale": None, "integration": INTEGRATION,
    "line_area": ("inclined", "projected"), "cells": None, "order": None, "wrinkling": ("on", "off"),
    "trim": None, "start_angle": None,
}  # fmt: skip

NUMBERS = (
    "panels_per_section",
    "canopy_stations",
    "canopy_subdivisions",
    "scale",
    "cells",
    "order",
    "trim",
    "start_angle",
)
FRACTIONS = ("scale", "trim", "start_angle")  # of NUMBERS, those that need not be whole


def offered_settings(label: str, settings: Any) -> dict[str, Setting]:
    """The [settings.NAME] tables: a text default with its options, or a whole-number default with its bounds."""
    if not isinstance(settings, dict):
        raise SceneError(f"{label}: [settings] must hold tables; write [settings.NAME] with a default.")
    return {key: _offered(f"{label}: [settings.{key}]", key, option) for key, option in settings.items()}


def _offered(place: str, key: str, option: Any) -> Setting:
    if key not in OPTIONS:
        raise SceneError(f"{place} has no meaning; known settings are: {', '.join(OPTIONS)}.")
    if not isinstance(option, dict) or "default" not in option:
        raise SceneError(f"{place} must be a table with a default; add 'default = ...'.")
    default, about = option["default"], str(option.get("description", ""))
    if isinstance(default, str) and key in NUMBERS:
        raise SceneError(f"{place} default must be a number; correct it.")
    if isinstance(default, float) and key in NUMBERS and key not in FRACTIONS:
        raise SceneError(f"{place} default must be a whole number; correct it.")
    if isinstance(default, int | float) and not isinstance(default, bool) and key not in NUMBERS:
        raise SceneError(f"{place} default must be a text; correct it.")
    if isinstance(default, str):
        choices = option.get("options")
        if not isinstance(choices, list) or not choices or not all(isinstance(c, str) for c in choices):
            raise SceneError(f"{place} options must be a list of texts that the setting may have; add it.")
        known = OPTIONS[key] or choices
        if odd := [c for c in choices if c not in known]:
            raise SceneError(f"{place} option '{odd[0]}' has no meaning; there are: {', '.join(known)}.")
        offer = Setting(default, tuple(choices), description=about)
    elif isinstance(default, bool) or not isinstance(default, int | float):
        raise SceneError(f"{place} default must be a text or a whole number; correct it.")
    else:
        kind = (int, "a whole number") if isinstance(default, int) else (int | float, "a number")
        for bound in ("minimum", "maximum"):
            if isinstance(option.get(bound, 1), bool) or not isinstance(option.get(bound, 1), kind[0]):
                raise SceneError(f"{place} {bound} must be {kind[1]}; correct it.")
        offer = Setting(default, (), option.get("minimum", 1), option.get("maximum", 100), about)
    setting(place, default, offer)
    return offer


def setting(place: str, value: Any, offer: Setting) -> Any:
    """The value of a setting, if its offer allows it."""
    if isinstance(offer.default, str):
        if not isinstance(value, str) or value not in offer.options:
            raise SceneError(f"{place} cannot be '{value}'; choose one of: {', '.join(offer.options)}.")
        return value
    whole = isinstance(offer.default, int)
    try:
        number = int(str(value)) if whole else float(str(value))
    except ValueError:
        kind = "a whole number" if whole else "a number"
        raise SceneError(f"{place} must be {kind}, not '{value}'; correct it.") from None
    if not offer.minimum <= number <= offer.maximum:
        raise SceneError(f"{place} must lie between {offer.minimum} and {offer.maximum}; it is {number}.")
    return number


def variant(label: str, variants: Any, chosen: str | None, known_sections: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Section -> key -> value of the chosen variant, which go before those of the sections themselves."""
    if not isinstance(variants, dict):
        raise SceneError(
            f"{label}: [variants] must hold tables; write [variants.NAME.SECTION] with the keys to change."
        )
    for name, sections in variants.items():
        right = isinstance(sections, dict) and all(
            s in known_sections and isinstance(k, dict) for s, k in sections.items()
        )
        if not right:
            known = ", ".join(known_sections)
            raise SceneError(f"{label}: [variants.{name}] must hold tables of the sections {known}; correct it.")
    if chosen is None:
        return {}
    if chosen not in variants:
        raise SceneError(f"{label} has no [variants.{chosen}]; add it or choose another variant.")
    return variants[chosen]
