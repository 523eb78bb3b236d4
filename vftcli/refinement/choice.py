"""What a user may choose of what only a complete log allows: bands, and bias removal."""

from dataclasses import dataclass

from vftcli.signals.parsing import check_known

NOTHING = "none"
"""The word for a bias that stays."""

REMOVALS = (NOTHING, "free-cycle", "model")
"""What ``--remove-bias`` takes; `vftcli.refinement.bias.REMOVALS` makes them."""


@dataclass(frozen=True, kw_only=True)
class RefinementChoice:
    """What is done with the estimates once the whole log is known.

    Attributes:
        bands: Whether to measure on the free part how far the estimates may be off.
        remove_bias: "none", "free-cycle" or "model".

    Raises:
        ParameterError: If there is no such way to remove a bias.
    """

    bands: bool = False
    remove_bias: str = NOTHING

    def __post_init__(self) -> None:
        check_known(self.remove_bias, REMOVALS, f"--remove-bias {self.remove_bias!r}")

    @classmethod
    def parsed(cls, *, bands: bool = False, remove_bias: str | None = None) -> "RefinementChoice":
        """The choice that ``--bands`` and ``--remove-bias`` state."""
        return cls(bands=bands, remove_bias=remove_bias or NOTHING)

    @property
    def removes_bias(self) -> bool:
        """Whether a bias is taken off."""
        return self.remove_bias != NOTHING

    @property
    def at_phase(self) -> bool:
        """Whether the bias taken off is what the free motion reads at the same phase."""
        return self.remove_bias == "free-cycle"

    @property
    def looks_back(self) -> bool:
        """Whether it needs the log's free part."""
        return self.bands or self.removes_bias
