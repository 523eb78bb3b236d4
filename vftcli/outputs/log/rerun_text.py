"""Text the Rerun viewer can draw: it stops at the first letter that its font lacks."""

import unicodedata

SPELLED = {
    "ᵀ": "^T",
    "⁻": "^-",
    "√": "sqrt ",
    "≤": "<=",
    "≥": ">=",
    "≈": "~",
    "→": "->",
    "−": "-",
    "–": "-",
    "—": "-",
    "…": "...",
    "‘": "'",
    "’": "'",
    "“": '"',
    "”": '"',
    "∂": "d",
    "Σ": "sum ",
    "ẋ": "dx",
}
"""How to write what the font may lack."""


def drawable(text: str) -> str:
    """Text in Latin-1 and Greek; further accents are dropped, other letters become "?"."""
    spelled = "".join(SPELLED.get(letter, letter) for letter in text)
    return "".join(letter_drawn(letter) for letter in spelled)


def letter_drawn(letter: str) -> str:
    """One letter, or what stands for it."""
    if letter == "\n" or " " <= letter <= "~" or "\u00a0" <= letter <= "\u00ff":
        return letter
    if "\u0391" <= letter <= "\u03c9":
        return letter
    plain = [
        part for part in unicodedata.normalize("NFKD", letter) if not unicodedata.combining(part)
    ]
    if unicodedata.combining(letter):
        return ""
    return "".join(
        part if " " <= part <= "~" or "\u0391" <= part <= "\u03c9" else "?" for part in plain
    )
