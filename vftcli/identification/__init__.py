"""Identification: logs become a robot. `fitting.identify` does it all.

Here is the user's choice of it.
"""

from typing import Annotated

from vftcli.signals.errors import ParameterError
from vftcli.signals.option import Choice, Option, interval, is_yes


class Task(Choice):
    """Method and settings of an identification."""

    #: None: friction, or base if the links are not the arm's.
    method: Annotated[
        str | None,
        Option(
            "--method",
            "friction|base|targets|payload|gains",
            "Fit friction, base, targets, payload or gains.",
        ),
    ] = None
    #: End of the used band. [Hz]
    cutoff: Annotated[
        float, Option("identify.cutoff", "HZ", "Cutoff of the zero-phase filter before a fit.")
    ] = 8.0
    #: Whether the friction method also fits drive constants.
    constants: Annotated[
        bool,
        Option(
            "identify.constants", "yes|no", "Whether friction fits drive constants K too.", is_yes
        ),
    ] = False
    #: The span of the logs for the check, None for all. [s]
    check_interval: Annotated[
        tuple[float, float] | None,
        Option("identify.check-interval", "A:B", "Seconds A to B of the --check logs.", interval),
    ] = None
    name: str = ""  #: Name of the new robot.
    #: Whether the joints have friction to fit; a simulator's may have none.
    friction: bool = True

    def __post_init__(self) -> None:
        if not 0.0 < self.cutoff < 1e4:
            raise ParameterError(f"cutoff is {self.cutoff:g} Hz; it must be positive")
        if self.constants and self.method not in {None, "friction"}:
            raise ParameterError("--set identify.constants=yes is for --method friction")
        if self.method == "targets" and not self.friction:
            raise ParameterError(
                "--method targets reads the controller's friction; leave model.friction=none out"
            )

    @property
    def keeps_links(self) -> bool:
        """Whether the profile's links stay, or the fit begins with them."""
        return self.method in {None, "friction"}
