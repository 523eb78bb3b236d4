"""Can it be believed? What supports the answer and what limits it, with its remedy as a command."""

from collections.abc import Sequence
from html import escape

from vftcli.outputs.believability import Ground


def believability_section(grounds: Sequence[Ground]) -> str:
    """The grounds side by side; the worst first, as they come."""
    items = "".join(map(ground_item, grounds))
    return (
        '<section id="believed"><h2>Can it be believed?</h2>'
        f'<ul class="grounds">{items}</ul></section>'
    )


def capital(text: str) -> str:
    """A text with its first letter large."""
    return text[:1].upper() + text[1:]


def ground_item(ground: Ground) -> str:
    """One ground: its sign, what it is about, what is known of it, and what would mend it."""
    remedy = ""
    if ground.remedy:
        remedy = f'<code class="remedy">{escape(ground.remedy)}</code>'
    return (
        f'<li><b class="sign {ground.standing}">{ground.mark}</b><span>'
        f"{escape(capital(ground.subject))}<small>{escape(ground.sentence)}{remedy}</small></span></li>"
    )
