"""Colours of observers and reference, for page and recording."""

from collections.abc import Sequence

#: Okabe and Ito's hues, in tones that stand out from white and from black paper alike.
COLOURS = {
    "best": "#d3224b",
    "fdo": "#2f86d0",
    "gmo": "#dd6415",
    "kfo-fe": "#0c9f76",
    "kfo-zoh": "#c95fa4",
    "kfo-rts": "#b98900",
    "kfo-auto": "#7a6fd6",
    "rts-auto": "#a0522d",
}
#: For estimates that have no colour of their own, in turn.
SPARE = ("#2f86d0", "#dd6415", "#0c9f76", "#c95fa4", "#b98900", "#7a6fd6", "#a0522d", "#5b8c00")
#: The reference on an unknown background; the page uses the colour of its ink.
REFERENCE = "#8a929a"
#: The part of the arm that was touched, in words → its colour.
PLACES = {
    "wrist": "#dd6415",
    "forearm": "#2f86d0",
    "upper arm": "#c95fa4",
    "cannot tell": "#c8a200",
}


def colours_of_names(names: Sequence[str]) -> dict[str, str]:
    """One colour for each estimate's name; two share one only if none is left."""
    taken = {COLOURS[name] for name in names if name in COLOURS}
    # An estimate without a colour of its own does not get one that another has.
    free = [colour for colour in SPARE if colour not in taken] or list(SPARE)
    others = [name for name in names if name not in COLOURS]
    spare = {name: free[k % len(free)] for k, name in enumerate(others)}
    return {name: COLOURS.get(name) or spare[name] for name in names}


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue of ``#rrggbb``, each from 0 to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
