"""A free run beside the log it serves: where in it each moment of the log belongs."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vftcli.robots.run import Run
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.recording import Recording

# A plain estimate has no free run: what aligns one with a log is loaded when it is asked for.
if TYPE_CHECKING:
    from vftcli.repetition.alignment import Alignment
    from vftcli.repetition.pairing import Pairing


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeRun:
    """A motion in another recording that nobody touched, beside the log it serves.

    Everything that is asked of it, by references, zero and bands, is made once.
    """

    run: Run  #: The free run.
    log: Run  #: The log.

    @cached_property
    def _alignment(self) -> "Alignment | ReferenceTorqueError":
        from vftcli.repetition.alignment import align

        try:
            return align(self.log.recording, self.recording)
        except ReferenceTorqueError as error:
            return error

    @property
    def recording(self) -> Recording:
        """The free run as it was read."""
        return self.run.recording

    @property
    def is_same_motion(self) -> bool:
        """Whether it follows the log's trajectory, or a part of it."""
        return not isinstance(self._alignment, ReferenceTorqueError)

    @property
    def alignment(self) -> "Alignment":
        """Its alignment with the log."""
        if isinstance(self._alignment, ReferenceTorqueError):
            raise self._alignment
        return self._alignment

    @cached_property
    def pairing(self) -> "Pairing":
        """Instant in the free run of each sample of the log."""
        from vftcli.repetition.pairing import pair_with_run

        found = self.alignment
        pairing = pair_with_run(self.log.t, self.run, found.shift, found.rate)
        return pairing._replace(times=np.where(found.overlap, pairing.times, np.nan))
