"""Errors a user can cause and can mend.

Every message is one line: what is wrong, what there is, what to do.
"""

from typing import Any


class VftError(Exception):
    """Base class of every error that is the input's fault."""


class ShapeError(VftError):
    """An array has another shape than its neighbours call for."""


class ClockError(VftError):
    """A time axis does not increase, or has too few samples."""


class LogError(VftError):
    """A log cannot be read as what it claims to be."""


class UnknownFormatError(LogError):
    """No reader recognises the file, or more than one does."""


class NoLogError(LogError):
    """A file that can be read holds no motion of an arm."""


class MissingSignalError(VftError):
    """A computation needs a signal that the log does not have."""


class RobotError(VftError):
    """A robot description is missing, incomplete or unphysical."""


class UnsettledRobotError(RobotError):
    """No robot is named, and the log does not settle it."""

    def __init__(self, message: str, recording: object) -> None:
        super().__init__(message)
        self.recording: Any = recording  #: The log.


class ParameterError(VftError):
    """A parameter is unknown, or outside its range."""


class ReferenceTorqueError(VftError):
    """A reference cannot be made from what was given."""


class OutputError(VftError):
    """A file cannot be written, or exists and --force was not given."""


class IdentificationError(VftError):
    """A log does not determine what is sought, or contradicts the robot."""


class PackageError(VftError):
    """A needed package is not installed."""


class ExaminationError(VftError):
    """The examination of a log found every result meaningless."""
