"""The supervisor: the last word before the wire. It knows no law, does no I/O, and may only refuse or stop."""
