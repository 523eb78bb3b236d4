"""A printed table beside one's own, for the terminal."""

from vftcli.evaluation.print_table import Comparison
from vftcli.outputs.log.tables import line, significant


def terminal_published(found: Comparison) -> str:
    """Two lines an observer, printed and computed, and where they differ and why."""
    joints = range(1, len(found.floor) + 1)
    header = ["observer", *(f"J{j}" for j in joints)]
    body = []
    for name in found.names:
        body.append([f"{name}, printed", *(f"{v:.4f}" for v in found.printed(name))])
        body.append([f"{name}, here", *map(significant, found.ours[name])])
    body.append(["floor, here", *map(significant, found.floor)])
    widths = [max(len(row[c]) for row in [header, *body]) for c in range(len(header))]
    lines = [line(row, widths).rstrip() for row in [header, *body]]
    title = f"{found.recording} beside {found.published.title}, N·m"
    return "\n".join([title, *lines, "", *(f"- {text}" for text in found.remarks), ""])
