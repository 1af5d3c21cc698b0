"""Errors that carry evidence: what was given, what was expected, what to do."""


class BowdenError(Exception):
    """A failure that the user can mend; the command line prints it as one line and exits with code 2.

    >>> str(BowdenError("gain λ is -1", expected="a number above 0", do="correct [control.gains] in rig.toml"))
    'gain λ is -1; expected a number above 0; correct [control.gains] in rig.toml'
    """

    def __init__(self, what: str, *, expected: str = "", do: str = "") -> None:
        self.what, self.expected, self.do = what, expected, do
        super().__init__("; ".join(part for part in (what, f"expected {expected}" if expected else "", do) if part))


class LogError(BowdenError):
    """A recorded log that cannot be used."""


class ParameterError(BowdenError):
    """A parameter, setting or key that is unknown, missing or out of its range."""


class OutputError(BowdenError):
    """A result that cannot be written where it was asked for."""


class DriveError(BowdenError):
    """A bus or a drive that cannot be used, or does not do what is asked of it."""


class StreamError(BowdenError):
    """A live stream of signals that is not there, is not what was asked for, or cannot be made."""


class SafetyError(BowdenError):
    """A run that must not begin: a preflight that failed, or limits that contradict one another."""
